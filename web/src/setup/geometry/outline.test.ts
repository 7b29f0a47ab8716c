// Outlines: as the daemon judges them, and as walls are made of them.

import { expect, test } from "vitest";
import { area, firstCrossing, firstRepeat, isInside, middle, nearest, strip, turned } from "./outline";
import type { Corner } from "../plan/frame";

const U: Corner[] = [[0, 0], [6, 0], [6, 6], [4, 6], [4, 2], [2, 2], [2, 6], [0, 6]];

test("crossings are found and touches are not", () => {
  expect(firstCrossing([[0, 0], [4, 4], [4, 0], [0, 4]])).toEqual([0, 2]);
  expect(firstCrossing(U)).toBeNull();
  expect(firstCrossing(U.map((at, i) => (i === 4 ? [4, -1] : at)))).toEqual([0, 3]);
  expect(firstCrossing([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2], [1, 2], [1, 1], [0, 1]])).toBeNull();
  expect(firstRepeat([[0, 0], [1, 0], [1, 0], [0, 1]])).toBe(2);
  expect(firstRepeat([[0, 0], [1, 0], [0, 1], [0, 0]])).toBe(0);
  expect(firstRepeat(U)).toBeNull();
});

test("areas, middles and insides", () => {
  expect(area([[0, 0], [2, 0], [2, 1], [0, 1]])).toBe(2);
  expect(area([[0, 1], [2, 1], [2, 0], [0, 0]])).toBe(-2);
  expect(middle([[10, 0], [12, 0], [12, 1], [10, 1]])).toEqual([11, 0.5]);
  expect(middle([[0, 0], [2, 0]])).toEqual([1, 0]);
  expect(isInside(U, [1, 5])).toBe(true);
  expect(isInside(U, [3, 5])).toBe(false);
  expect(nearest([1, 3], [[0, 0], [4, 0]])).toEqual({ at: [1, 0], share: 0.25 });
  expect(turned([1, 0], [0, 0], 90)[1]).toBeCloseTo(1);
});

test("a wall along a line is as thick everywhere", () => {
  expect(strip([[0, 0], [4, 0]], 0.2)).toEqual([[0, -0.1], [4, -0.1], [4, 0.1], [0, 0.1]]);
  const bent = strip([[0, 0], [4, 0], [4, 4]], 0.2).map((at) => at.map((metres) => Number(metres.toFixed(6))));
  expect(bent).toEqual([[0, -0.1], [4.1, -0.1], [4.1, 4], [3.9, 4], [3.9, 0.1], [0, 0.1]]);
  // A line that turns back on itself makes no spike.
  const sharp = strip([[0, 0], [10, 0], [0, 0.1]], 0.2);
  expect(Math.max(...sharp.map(([x]) => x))).toBeLessThan(11);
});
