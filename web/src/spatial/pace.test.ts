import { expect, test } from "vitest";
import { coarsenessFor, rateOf } from "./pace";

test("a picture is as fine as its time allows", () => {
  expect(coarsenessFor(20, 40, 1)).toBe(1);
  expect(coarsenessFor(80, 40, 1)).toBe(1.5);
  expect(coarsenessFor(150, 40, 1)).toBe(2);
  expect(coarsenessFor(10_000, 40, 1)).toBe(3);
});

test("it does not swing to and fro at a border", () => {
  expect(coarsenessFor(38, 40, 1.5)).toBe(1.5);
  expect(coarsenessFor(25, 40, 1.5)).toBe(1);
});

test("a rate is of the last moments", () => {
  expect(rateOf([0, 1_000, 1_100, 1_200], 1_200)).toBeCloseTo(2.5);
  expect(rateOf([0, 10, 6_000, 7_000, 10_000], 10_000)).toBeCloseTo(0.5);
  expect(rateOf([], 0)).toBe(0);
});
