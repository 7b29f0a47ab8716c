// Zooming keeps what lies beneath the pointer, and places go to the screen and back.

import { expect, test } from "vitest";
import * as f from "./frame";

const PANE: f.Pane = { picture: [640, 360], screen: [320, 320] };
const near = (a: readonly number[], b: readonly number[]) => a.forEach((value, i) => expect(value).toBeCloseTo(b[i] ?? NaN, 9));

test("the whole picture fits and stands in the middle", () => {
  expect(f.whole(PANE)).toBe(0.5);
  near(f.toScreen(null, PANE, [0, 0]), [0, 70]);
  near(f.toScreen(null, PANE, [640, 360]), [320, 250]);
});

test("what lies beneath the pointer stays there", () => {
  const before = f.toPicture(null, PANE, [80, 200]);
  const closer = f.zoomed(null, PANE, 8, [80, 200]);
  near(f.toPicture(closer, PANE, [80, 200]), before);
  near(f.toPicture(closer, PANE, f.toScreen(closer, PANE, [123.25, 45.5])), [123.25, 45.5]);
  expect(f.zoomed(closer, PANE, 0.01)).toBeNull();
  expect(f.resolved(f.zoomed(closer, PANE, 1e6), PANE).scale).toBe(40);
});

test("a point beside the pane is brought into it", () => {
  const closer = f.zoomed(null, PANE, 8);
  expect(f.showing(closer, PANE, [320, 180])).toBe(closer);
  const [x, y] = f.toScreen(f.showing(closer, PANE, [600, 40]), PANE, [600, 40]);
  expect(x).toBeLessThanOrEqual(320);
  expect(y).toBeGreaterThanOrEqual(0);
  expect(f.showing(null, PANE, [640, 0])).toBeNull();
});
