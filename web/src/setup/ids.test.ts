// Ids read like their names, and names like their files.

import { expect, test } from "vitest";
import { idFrom, isId, nameFrom } from "./ids";

test("an id is made of a name, and no other has it", () => {
  expect(idFrom("North gate", [], "camera")).toBe("north-gate");
  expect(idFrom("Überweg Süd!", [], "camera")).toBe("uberweg-sud");
  expect(idFrom("North gate", ["north-gate", "north-gate-2"], "camera")).toBe("north-gate-3");
  expect(idFrom("門", [], "camera")).toBe("camera");
  expect(isId(idFrom("x".repeat(200), ["x".repeat(60)], "camera"))).toBe(true);
});

test("a file's name is a camera's", () => {
  expect(nameFrom("/clips/west_gate.webm")).toBe("West gate");
  expect(nameFrom("/pets/View_001/frame_%04d.jpg")).toBe("Frame");
  expect(nameFrom("")).toBe("");
});
