// How lenses bend what a pinhole would show: the twin of src/geometry/distortion/mod.rs.

import type { Point } from "../operate/orbit";
import { type Fold, UNFOLDED, brownConradyFold, fisheyeFold, isWithin } from "./fold";

export type Pair = readonly [number, number];

/** Distance along the optical axis below which a point has no texture coordinate, metres. */
export const NEAR_M = 0.01;
/** How far an undistorted point may miss when it is distorted again, relative to 1 + its radius. */
const ROUND_TRIP = 1e-10;
const FARTHEST_RADIUS = 1e7;

export type Distortion = {
  readonly model: "none" | "brown_conrady" | "fisheye";
  /** Eight of Brown and Conrady (k1 k2 p1 p2 k3 k4 k5 k6), four of a fisheye. */
  readonly k: readonly number[];
  readonly fold: Fold;
};

/** The distortion that a calibration names; a pinhole where its numbers are no lens. */
export function distortionOf(given: { model: Distortion["model"]; coefficients?: readonly number[] } | undefined): Distortion {
  const pinhole: Distortion = { model: "none", k: [], fold: UNFOLDED };
  if (!given || given.model === "none") return pinhole;
  const count = given.model === "fisheye" ? 4 : 8;
  const k = Array.from({ length: count }, (_, i) => given.coefficients?.[i] ?? 0);
  const fold = given.model === "fisheye" ? fisheyeFold(k) : brownConradyFold(k);
  return fold ? { model: given.model, k, fold } : pinhole;
}

/** Where the lens shows a point of the camera's axes, in focal lengths from the principal point; null where nowhere. */
export function distort({ model, k, fold }: Distortion, [x, y, z]: Point): Pair | null {
  if (model === "fisheye") return distortFisheye(k, [x, y, z], fold.maxTheta);
  if (!(z > NEAR_M) || !isWithin(fold, x / z, y / z)) return null;
  const shown = model === "none" ? ([x / z, y / z] as const) : brownConrady(k, x / z, y / z);
  return shown.every(Number.isFinite) ? shown : null;
}

/** The direction (not of length 1) in the camera's axes that the lens shows there; null where it shows none. */
export function undistort({ model, k, fold }: Distortion, place: Pair): Point | null {
  if (!place.every(Number.isFinite)) return null;
  if (model === "none") return [place[0], place[1], 1];
  if (model === "fisheye") return undistortFisheye(k, place, fold.maxTheta);
  const found = undistortBrownConrady(k, place, fold);
  return found ? [found[0], found[1], 1] : null;
}

function distortFisheye(k: readonly number[], [x, y, z]: Point, maxTheta: number): Pair | null {
  const length = Math.hypot(x, y, z);
  if (!Number.isFinite(length) || length <= NEAR_M) return null;
  const radius = Math.hypot(x, y);
  const theta = Math.atan2(radius, z);
  if (theta >= maxTheta) return null;
  if (radius === 0) return [0, 0];
  const factor = fisheyeTheta(k, theta)[0] / radius;
  return [x * factor, y * factor];
}

function undistortFisheye(k: readonly number[], [x, y]: Pair, maxTheta: number): Point | null {
  const radius = Math.hypot(x, y);
  if (radius === 0) return [0, 0, 1];
  const theta = invertIncreasing((angle) => fisheyeTheta(k, angle), radius, maxTheta);
  if (theta === null || Math.abs(fisheyeTheta(k, theta)[0] - radius) > ROUND_TRIP * (1 + radius)) return null;
  const factor = Math.sin(theta) / radius;
  return [x * factor, y * factor, Math.cos(theta)];
}

/** The distorted angle and its slope. */
function fisheyeTheta([k1 = 0, k2 = 0, k3 = 0, k4 = 0]: readonly number[], theta: number): Pair {
  const t = theta * theta;
  return [
    theta * (1 + t * (k1 + t * (k2 + t * (k3 + t * k4)))),
    1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4))),
  ];
}

/** The radial factor and its slope by s = r^2. */
function radialFactor([k1 = 0, k2 = 0, , , k3 = 0, k4 = 0, k5 = 0, k6 = 0]: readonly number[], s: number): Pair {
  const above = 1 + s * (k1 + s * (k2 + s * k3));
  const below = 1 + s * (k4 + s * (k5 + s * k6));
  const aboveSlope = k1 + s * (2 * k2 + s * 3 * k3);
  const belowSlope = k4 + s * (2 * k5 + s * 3 * k6);
  return [above / below, (aboveSlope * below - above * belowSlope) / (below * below)];
}

function brownConrady(k: readonly number[], x: number, y: number): Pair {
  const [p1, p2] = [k[2] ?? 0, k[3] ?? 0];
  const s = x * x + y * y;
  const [q] = radialFactor(k, s);
  return [x * q + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * q + p1 * (s + 2 * y * y) + 2 * p2 * x * y];
}

function undistortBrownConrady(k: readonly number[], place: Pair, fold: Fold): Pair | null {
  const target = Math.hypot(...place);
  if (target === 0) return [0, 0];
  const radial = (radius: number): Pair => {
    const [q, slope] = radialFactor(k, radius * radius);
    return [radius * q, q + 2 * slope * radius * radius];
  };
  const isRadial = (k[2] ?? 0) === 0 && (k[3] ?? 0) === 0;
  // The tangential terms may carry a point further out than the radial ones alone.
  const radius = invertIncreasing(radial, target, fold.maxRadius)
    ?? (!isRadial && Number.isFinite(fold.maxRadius) ? 0.999 * fold.maxRadius : null);
  if (radius === null) return null;
  const start: Pair = [(place[0] * radius) / target, (place[1] * radius) / target];
  const found = isRadial ? start : refined(k, start, place, fold);
  if (!found) return null;
  const [u, v] = brownConrady(k, ...found);
  return isWithin(fold, ...found) && Math.hypot(u - place[0], v - place[1]) <= ROUND_TRIP * (1 + target) ? found : null;
}

/** Newton in two dimensions with halved steps: within the fold the Jacobian is positive definite. */
function refined(k: readonly number[], start: Pair, place: Pair, fold: Fold): Pair | null {
  const [p1, p2] = [k[2] ?? 0, k[3] ?? 0];
  const missed = ([x, y]: Pair): Pair => {
    const [u, v] = brownConrady(k, x, y);
    return [u - place[0], v - place[1]];
  };
  let at = start;
  let miss = missed(at);
  for (let round = 0; round < 50; round += 1) {
    const [x, y] = at;
    const [q, slope] = radialFactor(k, x * x + y * y);
    const xx = q + 2 * (slope * x * x + p1 * y + 3 * p2 * x);
    const xy = 2 * (slope * x * y + p1 * x + p2 * y);
    const yy = q + 2 * (slope * y * y + 3 * p1 * y + p2 * x);
    const determinant = xx * yy - xy * xy;
    if (!(determinant > 0)) return null;
    const step: Pair = [(yy * miss[0] - xy * miss[1]) / determinant, (xx * miss[1] - xy * miss[0]) / determinant];
    let isCloser = false;
    for (let share = 1; share > 1e-12 && !isCloser; share /= 2) {
      const next: Pair = [x - step[0] * share, y - step[1] * share];
      const left = missed(next);
      isCloser = isWithin(fold, ...next) && Math.hypot(...left) < Math.hypot(...miss);
      if (isCloser) [at, miss] = [next, left];
    }
    // As good as rounding allows, or there is none: the caller's round trip tells which.
    if (!isCloser) break;
  }
  return at;
}

/** The x in [0, farthest] where an increasing function with f(0) = 0 has the value `target`: Newton's method held in a bracket. */
function invertIncreasing(valueAndSlope: (x: number) => Pair, target: number, farthest: number): number | null {
  let low = 0;
  let high = Number.isFinite(farthest) ? farthest : Math.min(Math.max(target, 1), FARTHEST_RADIUS);
  while (valueAndSlope(high)[0] < target) {
    if (Number.isFinite(farthest) || high >= FARTHEST_RADIUS) return null;
    [low, high] = [high, high * 2];
  }
  let x = Math.min(Math.max(target, low), high);
  for (let round = 0; round < 200; round += 1) {
    const [value, slope] = valueAndSlope(x);
    if (value < target) low = x;
    else high = x;
    const newton = x - (value - target) / slope;
    const next = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (Math.abs(next - x) <= 1e-16 * (1 + x)) return next;
    x = next;
  }
  return x;
}
