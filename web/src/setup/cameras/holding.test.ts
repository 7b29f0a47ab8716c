// A camera in the hand goes where keys and handles say, and keeps the rest.

import { expect, test } from "vitest";
import * as h from "./holding";
import { aim, first } from "./torch";

const CAMERA = first({ version: 1 }, [640, 360]);
const near = (a: readonly number[] | undefined, b: readonly number[]) => b.forEach((value, i) => expect(a?.[i]).toBeCloseTo(value, 6));

test("keys turn, move, lift, roll and zoom", () => {
  const after = (key: string, isShift = false) => h.keyed(CAMERA, key, isShift) ?? CAMERA;
  expect(h.anglesOf(after("ArrowRight")).heading_deg).toBeCloseTo(0.25, 6);
  expect(h.anglesOf(after("ArrowDown", true)).tilt_deg - h.anglesOf(CAMERA).tilt_deg).toBeCloseTo(2, 6);
  expect(h.anglesOf(after("E", true)).roll_deg).toBeCloseTo(2, 6);
  near(after("w", true).position_m, [0, -9, 5]);
  near(after("d").position_m, [0.1, -10, 5]);
  near(after("PageUp", true).position_m, [0, -10, 6]);
  expect(h.fovOf(after("z"))).toBeCloseTo(60 / 1.01, 6);
  expect(h.keyed(CAMERA, "k", false)).toBeNull();
});

test("carried, it points where it pointed; pointed, it stands where it stood", () => {
  const carried = h.carriedTo(CAMERA, [7, -7, 4], 0);
  near(carried.position_m, [7, -7, 4]);
  near(aim(carried, 0), [0, 0, 0]);
  near(aim(h.pointedAt(CAMERA, [3, 4, 0]), 0), [3, 4, 0]);
  near(h.pointedAt(CAMERA, [3, 4, 0]).position_m, CAMERA.position_m);
});

test("the field of view keeps pixels as oblong as they were, and sane", () => {
  const oblong = h.withFov({ ...CAMERA, focal_px: [500, 550] }, 90);
  near(oblong.focal_px, [320, 352]);
  expect(h.fovOf(h.withFov(CAMERA, 500))).toBeCloseTo(150, 6);
});
