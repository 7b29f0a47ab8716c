// Places go to the map and back, what is under the pointer stays there, and all of a world is shown.

import { expect, test } from "vitest";
import { boundsOf, fitted, gridLines, panned, roundStep, toScreen, toWorld, zoomed } from "./frame";

const frame = { center: [10, -4], scale: 20, size_px: [800, 600] } as const;

test("places go to the map and back, north up", () => {
  expect(toScreen(frame, [10, -4])).toEqual([400, 300]);
  expect(toScreen(frame, [11, -3])).toEqual([420, 280]);
  expect(toWorld(frame, toScreen(frame, [3.25, 7.5]))).toEqual([3.25, 7.5]);
});

test("what is under the pointer stays there", () => {
  const at = [123, 456] as const;
  const held = toWorld(frame, at);
  const after = toWorld(zoomed(frame, 1.7, at), at);
  expect(after[0]).toBeCloseTo(held[0]);
  expect(after[1]).toBeCloseTo(held[1]);
  const [x, y] = toScreen(panned(frame, [30, -12]), held);
  expect(x).toBeCloseTo(153);
  expect(y).toBeCloseTo(444);
});

test("all of a world is shown", () => {
  const fit = fitted(boundsOf([[0, 0], [100, 10]]), [800, 600]);
  expect(toScreen(fit, [0, 0])[0]).toBeCloseTo(64);
  expect(toScreen(fit, [100, 10])[0]).toBeCloseTo(736);
  expect(fitted(null, [800, 600]).center).toEqual([0, 0]);
  expect(fitted(boundsOf([[5, 5]]), [800, 600]).scale).toBeLessThan(1e4);
});

test("grids are round and not too dense", () => {
  expect([0.03, 1, 1.2, 3, 7].map(roundStep)).toEqual([0.05, 1, 2, 5, 10]);
  expect(gridLines({ ...frame, size_px: [80, 60] }, 0, 1)).toEqual([8, 10, 12]);
});
