// The table becomes curves, and axes hold them.

import { expect, test } from "vitest";
import { stages, drawnIn } from "../timing";
import { type Row, type Table, curves, front, rmse } from "./curves";
import { at, scaleOf, short, ticks } from "./scale";

const row = (stage: string, knob: string, value: string, median: number, error: number | null, is_default = false): Row => ({
  stage, knob, value, is_default, error, memory_bytes: 0, measures: {}, time_ms: { median, lower_quartile: median, upper_quartile: median, count: 1 },
});
const table = (rows: Row[]) => ({ rows }) as unknown as Table;

test("settings of a knob are joined, the cheapest first, and whole pipelines by their front", () => {
  const [map, pipeline] = curves(table([
    row("map", "builder", "grid", 90, 0.1), row("map", "builder", "ray", 60, 0.001, true), row("map", "other", "x", 1, null),
    row("pipeline", "whole", "a", 50, 30), row("pipeline", "whole", "b", 60, 35), row("pipeline", "whole", "c", 80, 20),
  ]));
  expect(map?.lines.map((line) => line.map(({ value }) => value))).toEqual([["ray", "grid"]]);
  expect(map?.unjudged).toBe(1);
  expect(pipeline?.lines[0]?.map(({ value }) => value)).toEqual(["a", "c"]);
  expect(front([])).toEqual([]);
});

test("an axis has round values within what it shows", () => {
  const even = scaleOf([40, 60]);
  expect(even.isLog).toBe(false);
  expect(ticks(even)).toEqual([40, 45, 50, 55, 60]);
  const wide = scaleOf([68, 3_171]);
  expect(wide.isLog).toBe(true);
  expect(ticks(wide)).toEqual([100, 300, 1_000, 3_000]);
  expect(at(wide, wide.least)).toBeCloseTo(0);
  expect(at(even, even.most)).toBeCloseTo(1);
  expect(ticks(scaleOf([5.8e-7, 0.0189])).every((value) => value > 0)).toBe(true);
  expect([0, 0.0000006, 0.125, 12.34, 3_171.2].map(short)).toEqual(["0", "6.0e-7", "0.125", "12.3", "3171"]);
});

test("pictures' differences are told in codes", () => {
  expect(rmse(new Uint8ClampedArray([0, 0, 0, 255]), new Uint8ClampedArray([3, 3, 3, 0]))).toBe(3);
});

test("what a picture took is read", () => {
  const told = stages("wait;dur=2.5, fuse;dur=89.8, plan;dur=9, render;dur=100.25, surface;dur=79");
  expect(told[0]).toEqual({ name: "wait", millis: 2.5 });
  expect(drawnIn(told)).toBeCloseTo(199.05);
  expect(stages(null)).toEqual([]);
});
