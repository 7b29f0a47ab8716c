import { expect, test } from "vitest";
import { idFor } from "./viewids";

test("a name becomes an id of its own", () => {
  expect(idFor("Gate from above", new Set())).toBe("gate-from-above");
  expect(idFor("Entrée no. 2", new Set(["entree-no-2"]))).toBe("entree-no-2-2");
  expect(idFor("門", new Set())).toBe("view");
  expect(idFor("Gate", new Set(["gate", "gate-k3f9q2ma"]), "-k3f9q2ma")).toBe("gate-2-k3f9q2ma");
});
