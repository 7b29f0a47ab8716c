// What is counted of a screen's frames.

import { expect, test } from "vitest";
import { NOTHING, counted, delayOf, rateOf, together } from "./health";

const frame = (number: number, at: number, version = "1") => ({ number, version, rate: 2, at });

test("frames are counted, and those passed over or shown late", () => {
  let counts = counted(NOTHING, frame(10, 0), 0);
  counts = counted(counts, frame(11, 500), 400);
  counts = counted(counts, frame(14, 2_000), 700);
  expect([counts.missed, counts.late, counts.newest?.number]).toEqual([2, 1, 14]);
  // Another version of the wall numbers anew.
  counts = counted(counts, frame(90, 2_500, "2"), 0);
  expect(counts.missed).toBe(2);
});

test("the rate is of the last seconds", () => {
  const counts = [0, 500, 1_000, 1_500].reduce((sum, at, i) => counted(sum, frame(i, at), 0), NOTHING);
  expect(rateOf(counts, 1_600)).toBeCloseTo(2);
  expect(rateOf(counts, 9_000)).toBe(0);
  expect(rateOf(NOTHING, 0)).toBe(0);
});

test("screens are in step where their frames are alike", () => {
  expect(together(10, [{ frame: 10 }, { frame: 11 }, { frame: null }])).toEqual({ n: 2, apart: 1 });
  expect(together(null, [{ frame: 3 }])).toEqual({ n: 1, apart: 0 });
  expect(together(4, [])).toEqual({ n: 0, apart: 0 });
});

test("screens wait as long as they are told, else a frame's time", () => {
  expect([delayOf(null, 10), delayOf(null, 2), delayOf("80", 2), delayOf("9000", 2), delayOf(null, 0)]).toEqual([100, 250, 80, 2_000, 0]);
});
