// Pixels and places lead to each other, and zooming keeps what is under the pointer.

import { expect, test } from "vitest";
import { panned, toPixel, toWorld, whole, zoomedAt } from "./mapscale";

const size = [400, 200] as const;
const place = whole({ low: [-10, -10], high: [30, 10] }, size);

test("all of it is in the picture, north up", () => {
  expect(place.center).toEqual([10, 0]);
  const [left, top] = toPixel(place, size, [-10, 10]);
  const [right, bottom] = toPixel(place, size, [30, -10]);
  expect(left).toBeGreaterThan(0);
  expect(top).toBeGreaterThan(0);
  expect(right).toBeLessThan(400);
  expect(bottom).toBeLessThan(200);
  expect(top).toBeLessThan(bottom);
});

test("a pixel's place has that pixel, also after zooming and moving", () => {
  const pixel = [37, 151] as const;
  const at = toWorld(place, size, pixel);
  const zoomed = zoomedAt(place, size, pixel, 0.3);
  expect(toPixel(zoomed, size, at)[0]).toBeCloseTo(37, 6);
  expect(toPixel(zoomed, size, at)[1]).toBeCloseTo(151, 6);
  const [x, y] = toPixel(panned(place, size, 10, -4), size, at);
  expect(x).toBeCloseTo(47, 6);
  expect(y).toBeCloseTo(147, 6);
});
