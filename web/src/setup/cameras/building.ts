// From lines along a building to a calibration: the daemon finds direction and focal length, pairs or a height say where the camera
// stands. A line does not say which of its ends is ahead, so that the camera may look the other way round.

import type { Point } from "../../operate/orbit";
import { lensOf } from "../../spatial/lens";
import type { AxisLine, Calibration, Pair } from "../draft";
import type { Turned } from "../requests";
import { type Pixel, fit, standing } from "./pairs";
import { type Quaternion, aboutVertical, dot, minus, point, product, quaternion, turned } from "./torch";

/** Fewest lines along an axis that meet somewhere, and of so many axes. */
const LEAST_LINES = 2;
const LEAST_AXES = 2;

export const AXES = ["x", "y", "z"] as const;

/** How many lines of which axes are still missing; nothing where there are enough. */
export function missing(lines: readonly AxisLine[]): { axis: AxisLine["axis"]; n: number }[] {
  const counts = AXES.map((axis) => ({ axis, n: LEAST_LINES - lines.filter((line) => line.axis === axis).length }));
  if (counts.filter(({ n }) => n <= 0).length >= LEAST_AXES) return [];
  // Those that are begun are named first.
  const open = counts.filter(({ n }) => n > 0).sort((a, b) => a.n - b.n);
  return open.slice(0, LEAST_AXES - (AXES.length - open.length));
}

/** The lines that tell something: of axes that have enough of them. */
export function telling(lines: readonly AxisLine[]): AxisLine[] {
  return lines.filter(({ axis }) => lines.filter((other) => other.axis === axis).length >= LEAST_LINES);
}

/** A direction that was found by lines along a building that stands turned by `yawDeg`. */
export function inWorld(found: Quaternion, yawDeg: number): Quaternion {
  return product(aboutVertical(yawDeg), found);
}

/** The other direction that shows the same lines. */
export const otherWay = (direction: Quaternion): Quaternion => product(aboutVertical(180), direction);

export type Placed = { readonly calibration: Calibration; readonly isPlaced: boolean };

function base(found: Turned, size: Pixel, direction: Quaternion, position: Point): Calibration {
  return {
    image_size_px: [...size],
    focal_px: [found.focal_px, found.focal_px],
    center_px: [size[0] / 2, size[1] / 2],
    distortion: { model: "none" },
    position_m: [...position],
    world_from_camera: [...direction],
  };
}

function at(of: Calibration, pairs: readonly Pair[], height_m: number | null): Placed & { error: number } {
  const position = pairs.length > 0 ? standing(lensOf(of), pairs, height_m) : null;
  if (!position) return { calibration: of, isPlaced: false, error: Infinity };
  const calibration = { ...of, position_m: [...position] };
  return { calibration, isPlaced: true, error: fit(lensOf(calibration), pairs).rms_px ?? Infinity };
}

/** The calibration of what was found: turned so that it fits the pairs, else so that it looks towards `middle`. */
export function placed(found: Turned, size: Pixel, yawDeg: number, pairs: readonly Pair[], height_m: number | null, before: Point, middle: Point, isOtherWay: boolean): Placed {
  const one = inWorld(quaternion(found.world_from_camera), yawDeg);
  const ways = [one, otherWay(one)].map((direction) => at(base(found, size, direction, before), pairs, height_m));
  const looks = (of: Calibration) => dot(turned(quaternion(of.world_from_camera), [0, 0, 1]), minus(middle, point(of.position_m)));
  const [a, b] = ways as [(typeof ways)[0], (typeof ways)[0]];
  // Where pairs do not tell the two apart, or there are none, it is the one that sees the scene.
  const isFirst = a.error === b.error ? looks(a.calibration) >= looks(b.calibration) : a.error < b.error;
  return isFirst !== isOtherWay ? a : b;
}
