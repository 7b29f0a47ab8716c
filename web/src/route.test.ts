// Addresses say where the viewer is, and what is unknown in them leads to Operate.

import { expect, test } from "vitest";
import { parse, print } from "./route";

test("what is printed is read again", () => {
  const route = { place: "operate", details: { scene: "plaza", eye: "1,-2,3", at: "2026-03-01T12:00:00.5Z" } } as const;
  expect(print(route)).toBe("#/operate?scene=plaza&eye=1,-2,3&at=2026-03-01T12:00:00.5Z");
  expect(parse(print(route))).toEqual(route);
});

test("what is not known leads to Operate", () => {
  for (const hash of ["", "#", "#/", "#/nothing", "#nothing?x"]) expect(parse(hash).place).toBe("operate");
  expect(parse("#/system")).toEqual({ place: "system", details: {} });
});
