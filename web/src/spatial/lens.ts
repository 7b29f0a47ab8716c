// A calibrated camera: which texel shows a place and which places a texel may show. The twin of src/geometry/camera.rs, for the
// contract's `Calibration`.

import type { components } from "../contract.gen";
import type { Point } from "../operate/orbit";
import { type Distortion, type Pair, distort, distortionOf, undistort } from "./distortion";

export { LENS_GLSL, lensDefines, lensUniform } from "./lensShader";

export type Calibration = components["schemas"]["Calibration"];
/** A half line in the world; the direction has length 1. */
export type Ray = { readonly origin: Point; readonly direction: Point };
/** Texture coordinates, [0, 1] within the picture from its upper left corner, and the distance along the axis. */
export type Projection = { readonly u: number; readonly v: number; readonly depth_m: number };

export type Lens = {
  readonly size: Pair;
  /** Focal lengths and principal point, shares of the picture's size. */
  readonly focal: Pair;
  readonly center: Pair;
  readonly distortion: Distortion;
  readonly position: Point;
  /** Rows: the camera's axes (x right, y down, z forward) in the world. */
  readonly axes: readonly [Point, Point, Point];
};

const pair = (numbers: readonly number[]): Pair => [numbers[0] ?? 0, numbers[1] ?? 0];

/** The lens of a calibration. */
export function lensOf(calibration: Calibration): Lens {
  const size = pair(calibration.image_size_px);
  const [focal, center] = [pair(calibration.focal_px), pair(calibration.center_px)];
  const [x = 0, y = 0, z = 0] = calibration.position_m;
  return {
    size,
    focal: [focal[0] / size[0], focal[1] / size[1]],
    center: [center[0] / size[0], center[1] / size[1]],
    distortion: distortionOf(calibration.distortion),
    position: [x, y, z],
    axes: axesOf(calibration.world_from_camera),
  };
}

/** The turned x, y and z axes of a quaternion x, y, z, w. */
export function axesOf(quaternion: readonly number[]): [Point, Point, Point] {
  const length = Math.hypot(...quaternion) || 1;
  const [x = 0, y = 0, z = 0, w = 1] = quaternion.map((part) => part / length);
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
}

const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** A world point in the camera's axes. */
export function local({ position, axes }: Lens, point: Point): Point {
  const offset: Point = [point[0] - position[0], point[1] - position[1], point[2] - position[2]];
  return [dot(axes[0], offset), dot(axes[1], offset), dot(axes[2], offset)];
}

/** A direction of the camera's axes in the world. */
export function turned({ axes: [right, down, forward] }: Lens, [x, y, z]: Point): Point {
  return [
    right[0] * x + down[0] * y + forward[0] * z,
    right[1] * x + down[1] * y + forward[1] * z,
    right[2] * x + down[2] * y + forward[2] * z,
  ];
}

/** Where a world point lies in the picture or beside it; null behind the near plane and beyond where the lens folds back. */
export function project(lens: Lens, point: Point): Projection | null {
  const at = local(lens, point);
  const shown = distort(lens.distortion, at);
  if (!shown) return null;
  return { u: lens.focal[0] * shown[0] + lens.center[0], v: lens.focal[1] * shown[1] + lens.center[1], depth_m: at[2] };
}

/** Whether it lies within the picture. */
export function isInside({ u, v }: Projection): boolean {
  return u >= 0 && u <= 1 && v >= 0 && v <= 1;
}

/** The ray through a texture coordinate; null where the lens brings no light. */
export function ray(lens: Lens, [u, v]: Pair): Ray | null {
  const place: Pair = [(u - lens.center[0]) / lens.focal[0], (v - lens.center[1]) / lens.focal[1]];
  const toward = undistort(lens.distortion, place);
  if (!toward) return null;
  const [x, y, z] = turned(lens, toward);
  const length = Math.hypot(x, y, z);
  return length > 0 ? { origin: lens.position, direction: [x / length, y / length, z / length] } : null;
}

/** Where a ray comes down on (or up to) the level plane of height `z`; null where it never does. */
export function meetLevel({ origin, direction }: Ray, z: number): Point | null {
  const reach = (z - origin[2]) / direction[2];
  if (!(reach > 0) || !Number.isFinite(reach)) return null;
  return [origin[0] + direction[0] * reach, origin[1] + direction[1] * reach, z];
}

/** The outline of what the picture shows of the level plane of height `z`, at most `farthest` metres away along the ground; `steps`
 * places along every side. Empty where it shows nothing of it. */
export function footprint(lens: Lens, z: number, farthest = 200, steps = 8): Point[] {
  const sides = [[0, 0, 1, 0], [1, 0, 0, 1], [1, 1, -1, 0], [0, 1, 0, -1]] as const;
  const border = sides.flatMap(([u, v, du, dv]) =>
    Array.from({ length: steps }, (_, i): Pair => [u + (du * i) / steps, v + (dv * i) / steps]),
  );
  let isMet = false;
  const corners: Point[] = [];
  for (const place of border) {
    const through = ray(lens, place);
    if (!through) continue;
    const met = meetLevel(through, z);
    const { origin, direction } = through;
    if (met && Math.hypot(met[0] - origin[0], met[1] - origin[1]) <= farthest) {
      isMet = true;
      corners.push(met);
    } else {
      // Above the horizon, or too far: as far as is asked for in that direction.
      const level = Math.hypot(direction[0], direction[1]) || 1;
      corners.push([origin[0] + (direction[0] / level) * farthest, origin[1] + (direction[1] / level) * farthest, z]);
    }
  }
  return isMet ? corners : [];
}

/** The vertical field of view on the axis, degrees: what a viewer who stands there takes to see the whole picture. */
export function fovDeg(lens: Lens): number {
  const [top, bottom] = [ray(lens, [lens.center[0], 0]), ray(lens, [lens.center[0], 1])];
  if (!top || !bottom) return 170;
  return Math.min(170, (Math.acos(Math.min(1, Math.max(-1, dot(top.direction, bottom.direction)))) * 180) / Math.PI);
}
