import { expect, test } from "vitest";
import { idFor } from "./viewids";

test("a name becomes an id of its own", () => {
  expect(idFor("Gate from above", new Set())).toBe("gate-from-above");
  expect(idFor("Entrée no. 2", new Set(["entree-no-2"]))).toBe("entree-no-2-2");
  expect(idFor("門", new Set())).toBe("view");
});
