// A camera held like a torch: where it stands, where it points and how it is rolled, and the pose of that in a calibration.
// Camera axes: x right, y down, z forward; `world_from_camera` is a unit quaternion x, y, z, w. Angles in degrees as people set
// them: heading clockwise from north, tilt downwards from level, roll clockwise as seen from behind the camera.

import type { Point } from "../../operate/orbit";
import type { Calibration, SceneDocument } from "../draft";

export type Quaternion = readonly [number, number, number, number];
export type Angles = { readonly heading_deg: number; readonly tilt_deg: number; readonly roll_deg: number };
type Axes = { readonly right: Point; readonly down: Point; readonly forward: Point };

/** Where a camera without any calibration is taken to stand: metres over the ground, degrees across its picture. */
export const FIRST_HEIGHT_M = 5;
export const FIRST_FOV_DEG = 60;
/** How far ahead the aim of a camera lies that does not point at the ground. */
const AHEAD_M = 15;
const FARTHEST_AIM_M = 500;
/** Half the ground where none is drawn yet. */
const NO_GROUND_M = 10;

const RADIANS = Math.PI / 180;
export const add = (a: Point, b: Point, by = 1): Point => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
export const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Point, b: Point): Point => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Point) => Math.hypot(...a);
export const unit = (a: Point): Point => add([0, 0, 0], a, 1 / length(a));

/** Two turns after one another: first `b`, then `a`. */
export function product(a: Quaternion, b: Quaternion): Quaternion {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** A direction turned by a quaternion. */
export function turned([x, y, z, w]: Quaternion, of: Point): Point {
  const axis: Point = [x, y, z];
  const twice = add([0, 0, 0], cross(axis, of), 2);
  return add(add(of, twice, w), cross(axis, twice));
}

/** The turn whose inverse it is. */
export const inverse = ([x, y, z, w]: Quaternion): Quaternion => [-x, -y, -z, w];

/** The turn about the vertical, from east towards north. */
export function aboutVertical(yawDeg: number): Quaternion {
  return [0, 0, Math.sin((yawDeg * RADIANS) / 2), Math.cos((yawDeg * RADIANS) / 2)];
}

/** By how many degrees two directions of cameras differ. */
export function between(a: Quaternion, b: Quaternion): number {
  const [x, y, z, w] = product(inverse(a), b);
  return (2 * Math.atan2(Math.hypot(x, y, z), Math.abs(w))) / RADIANS;
}

/** The quaternion whose columns these axes are (Shepperd 1978: the largest of its members first, so that none is lost). */
function fromAxes({ right: [a, d, g], down: [b, e, h], forward: [c, f, i] }: Axes): Quaternion {
  const squares = [1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i];
  const largest = squares.indexOf(Math.max(...squares));
  const twice = Math.sqrt(squares[largest] ?? 1);
  const by = 0.5 / twice;
  if (largest === 0) return [twice / 2, (b + d) * by, (c + g) * by, (h - f) * by];
  if (largest === 1) return [(b + d) * by, twice / 2, (f + h) * by, (c - g) * by];
  if (largest === 2) return [(c + g) * by, (f + h) * by, twice / 2, (d - b) * by];
  return [(h - f) * by, (c - g) * by, (d - b) * by, twice / 2];
}

/** A camera's axes, in the world, before it is rolled. */
function level(heading: number, tilt: number): Axes {
  const forward: Point = [Math.sin(heading) * Math.cos(tilt), Math.cos(heading) * Math.cos(tilt), -Math.sin(tilt)];
  const right: Point = [Math.cos(heading), -Math.sin(heading), 0];
  return { right, down: cross(forward, right), forward };
}

/** The direction that angles mean. */
export function direction({ heading_deg, tilt_deg, roll_deg }: Angles): Quaternion {
  const axes = level(heading_deg * RADIANS, tilt_deg * RADIANS);
  const [sine, cosine] = [Math.sin(roll_deg * RADIANS), Math.cos(roll_deg * RADIANS)];
  const right = add(add([0, 0, 0], axes.right, cosine), axes.down, sine);
  return fromAxes({ right, down: cross(axes.forward, right), forward: axes.forward });
}

/** The angles of a direction. Straight down or up its heading is where the picture's top points. */
export function angles(worldFromCamera: Quaternion): Angles {
  const forward = turned(worldFromCamera, [0, 0, 1]);
  const right = turned(worldFromCamera, [1, 0, 0]);
  const isUpright = Math.hypot(forward[0], forward[1]) < 1e-6;
  const heading = isUpright ? Math.atan2(-right[1], right[0]) : Math.atan2(forward[0], forward[1]);
  const tilt = Math.asin(Math.min(Math.max(-forward[2], -1), 1));
  const unrolled = level(heading, tilt);
  const roll = Math.atan2(dot(right, unrolled.down), dot(right, unrolled.right));
  return { heading_deg: (heading / RADIANS + 360) % 360, tilt_deg: tilt / RADIANS, roll_deg: roll / RADIANS };
}

/** The direction from one place to another, rolled; as it was where both are the same. */
export function lookingAt(position: Point, aim: Point, rollDeg: number, before: Quaternion): Quaternion {
  const [x, y, z] = minus(aim, position);
  if (!(Math.hypot(x, y, z) > 1e-6)) return before;
  // Straight down there is no heading: the one from before stays.
  const flat = Math.hypot(x, y);
  const heading_deg = flat > 1e-6 * Math.abs(z) ? Math.atan2(x, y) / RADIANS : angles(before).heading_deg;
  return direction({ heading_deg, tilt_deg: Math.atan2(-z, flat) / RADIANS, roll_deg: rollDeg });
}

/** Where a camera's axis meets a level; a place ahead of it where it does not, or only far away. */
export function aim({ position_m, world_from_camera }: Pick<Calibration, "position_m" | "world_from_camera">, level_m: number): Point {
  const position = point(position_m);
  const forward = turned(quaternion(world_from_camera), [0, 0, 1]);
  const distance = forward[2] === 0 ? NaN : (level_m - position[2]) / forward[2];
  return add(position, forward, distance > 0.1 && distance < FARTHEST_AIM_M ? distance : AHEAD_M);
}

/** Degrees that a focal length shows over so many pixels, without distortion; and the way back. */
export const fov = (focalPx: number, acrossPx: number) => (2 * Math.atan(acrossPx / (2 * focalPx))) / RADIANS;
export const focal = (fovDeg: number, acrossPx: number) => acrossPx / (2 * Math.tan((fovDeg * RADIANS) / 2));

/** Numbers of a document as a place. */
export const point = (of: readonly number[]): Point => [of[0] ?? 0, of[1] ?? 0, of[2] ?? 0];
export const quaternion = (of: readonly number[]): Quaternion => [of[0] ?? 0, of[1] ?? 0, of[2] ?? 0, of[3] ?? 1];

export type Extent = { readonly low: readonly [number, number]; readonly high: readonly [number, number]; readonly level_m: number };

/** From where to where the ground of a scene reaches, and how high it lies (its largest part). */
export function extent(document: SceneDocument): Extent {
  const corners = [
    ...(document.ground ?? []).flatMap(({ polygon }) => polygon),
    ...(document.height_fields ?? []).flatMap(({ low_m: [x = 0, y = 0], step_m, columns, heights_m }) =>
      [[x, y], [x + (columns - 1) * step_m, y + (heights_m.length / columns - 1) * step_m]]),
  ];
  if (corners.length === 0) return { low: [-NO_GROUND_M, -NO_GROUND_M], high: [NO_GROUND_M, NO_GROUND_M], level_m: 0 };
  const [xs, ys] = [corners.map(([x = 0]) => x), corners.map(([, y = 0]) => y)];
  const level_m = document.ground?.[0]?.height_m ?? document.height_fields?.[0]?.heights_m[0] ?? 0;
  return { low: [Math.min(...xs), Math.min(...ys)], high: [Math.max(...xs), Math.max(...ys)], level_m };
}

/** A calibration to begin with: at the ground's edge, looking at its middle; others stand at other edges. */
export function first(document: SceneDocument, sizePx: readonly [number, number], idx = 0): Calibration {
  const { low, high, level_m } = extent(document);
  const middle: Point = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, level_m];
  const sides: readonly (readonly [number, number])[] = [[middle[0], low[1]], [high[0], middle[1]], [middle[0], high[1]], [low[0], middle[1]]];
  const [x, y] = sides[idx % sides.length] ?? [middle[0], low[1]];
  const position: Point = [x, y, level_m + FIRST_HEIGHT_M];
  const focalPx = focal(FIRST_FOV_DEG, sizePx[0]);
  return {
    image_size_px: [...sizePx],
    focal_px: [focalPx, focalPx],
    center_px: [sizePx[0] / 2, sizePx[1] / 2],
    distortion: { model: "none" },
    position_m: [...position],
    world_from_camera: [...lookingAt(position, middle, 0, [0, 0, 0, 1])],
  };
}
