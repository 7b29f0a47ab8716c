// Whoever is followed comes into the middle and stays there; the viewer's distance is kept.

import { expect, test } from "vitest";
import { eased } from "./following";
import type { View } from "./orbit";

const view: View = { eye: [0, -10, 5], target: [0, 0, 0], fov: 50 };

test("the way to them is gone without going too far", () => {
  let at: View = view;
  for (let i = 0; i < 200; i += 1) at = eased(at, [3, 4, 0], "orbit", 16) ?? at;
  expect(Math.hypot(at.target[0] - 3, at.target[1] - 4)).toBeLessThan(0.05);
  expect(at.eye[1] - at.target[1]).toBeCloseTo(-10, 9);
  expect(eased(at, [3, 4, 0], "orbit", 16)).toBeNull();
});

test("who walks turns the head only", () => {
  expect(eased(view, [3, 4, 0], "walk", 100)?.eye).toEqual(view.eye);
});
