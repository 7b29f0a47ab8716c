// Zooming keeps what is under the pointer, and ticks stand at round times.

import { expect, test } from "vitest";
import { LEAST_MILLIS, MOST_MILLIS, beyondGap, following, isCovered, label, nearestCovered, ticks, zoomed } from "./timescale";

const hour = { from: 0, to: 3_600e3 };

test("zooming keeps the time under the pointer in its place, within limits", () => {
  const near = zoomed(hour, 900e3, 0.5);
  expect((900e3 - near.from) / (near.to - near.from)).toBeCloseTo(0.25, 9);
  const least = zoomed(hour, 900e3, 0);
  expect(least.to - least.from).toBeCloseTo(LEAST_MILLIS, 6);
  const most = zoomed(hour, 900e3, 1e9);
  expect(most.to - most.from).toBeCloseTo(MOST_MILLIS, 0);
});

test("what is shown follows a time that leaves it", () => {
  expect(following(hour, 1_800e3)).toBe(hour);
  expect(following(hour, 3_700e3).to).toBeGreaterThan(3_700e3);
  expect(following(hour, -1e3).from).toBeLessThan(-1e3);
});

test("ticks are round and few", () => {
  const { at, step } = ticks(hour, 8);
  expect(step).toBe(600e3);
  expect(at).toHaveLength(7);
  expect(ticks({ from: 0, to: MOST_MILLIS }, 10).at.length).toBeLessThanOrEqual(11);
  expect(label(new Date(2026, 2, 1, 12, 5, 7, 40).getTime(), 40)).toBe("12:05:07.040");
  expect(label(new Date(2026, 2, 1, 12, 5).getTime(), 60e3)).toBe("12:05");
});

test("gaps are jumped over, and what is nearest is found", () => {
  const rows = [
    { camera: "west", ranges: [[0, 10e3], [60e3, 90e3]] as const, activity: [] },
    { camera: "east", ranges: [[0, 20e3]] as const, activity: [] },
  ];
  expect(isCovered(rows, 15e3)).toBe(true);
  expect(isCovered(rows, 40e3)).toBe(false);
  expect(beyondGap(rows, null, 40e3, 1)).toBe(60e3);
  expect(beyondGap(rows, null, 40e3, -1)).toBe(20e3);
  expect(beyondGap(rows, ["west"], 40e3, -1)).toBe(10e3);
  expect(beyondGap(rows, ["east"], 40e3, 1)).toBeNull();
  expect(nearestCovered(rows, 45e3)).toBe(60e3);
  expect(nearestCovered(rows, 75e3)).toBe(75e3);
  expect(nearestCovered([], 0)).toBeNull();
});
