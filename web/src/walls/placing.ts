// Where a rectangle stands, as people say it: its middle, its size and how it is turned; and moving it by hand.

import { type Corners, type Tile, add, bounds, cross, dot, minus, times } from "./layout";
import type { Point } from "../operate/orbit";

/** `yaw` turns it to the right about the vertical, `pitch` leans it back, `roll` turns it in its plane; degrees. */
export type Placing = { readonly middle: Point; readonly width: number; readonly height: number; readonly yaw: number; readonly pitch: number; readonly roll: number };

const DEGREE = Math.PI / 180;
const rounded = (value: number, to: number) => Math.round(value * to) / to + 0;

/** Across and up of a tile that is turned, but not in its plane. */
function axes(yaw: number, pitch: number): { right: Point; up: Point } {
  const right: Point = [Math.cos(yaw), 0, -Math.sin(yaw)];
  const normal: Point = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
  return { right, up: cross(normal, right) };
}

/** How a rectangle stands. */
export function placingOf([lowerLeft, lowerRight, upperLeft]: Corners): Placing {
  const [across, upwards] = [minus(lowerRight, lowerLeft), minus(upperLeft, lowerLeft)];
  const [width, height] = [Math.hypot(...across), Math.hypot(...upwards)];
  const normal = times(cross(across, upwards), 1 / Math.max(width * height, 1e-12));
  const [yaw, pitch] = [Math.atan2(normal[0], normal[2]), Math.asin(Math.min(Math.max(normal[1], -1), 1))];
  const { right, up } = axes(yaw, pitch);
  const degrees = (angle: number) => rounded(angle / DEGREE, 1e4);
  const middle = add(lowerLeft, times(add(across, upwards), 0.5));
  return {
    middle: [rounded(middle[0], 1e5), rounded(middle[1], 1e5), rounded(middle[2], 1e5)],
    width: rounded(width, 1e5), height: rounded(height, 1e5),
    yaw: degrees(yaw), pitch: degrees(pitch), roll: degrees(Math.atan2(dot(across, up), dot(across, right))),
  };
}

/** The corners of a rectangle that stands so. */
export function cornersOf({ middle, width, height, yaw, pitch, roll }: Placing): Corners {
  const { right, up } = axes(yaw * DEGREE, pitch * DEGREE);
  const [cos, sin] = [Math.cos(roll * DEGREE), Math.sin(roll * DEGREE)];
  const across = times(add(times(right, cos), times(up, sin)), width / 2);
  const upwards = times(minus(times(up, cos), times(right, sin)), height / 2);
  const exact = (point: Point): Point => [rounded(point[0], 1e6), rounded(point[1], 1e6), rounded(point[2], 1e6)];
  return [
    exact(minus(minus(middle, across), upwards)), exact(minus(add(middle, across), upwards)), exact(add(minus(middle, across), upwards)),
  ];
}

/** A tile that stands elsewhere. */
export function shifted(tile: Tile, by: Point): Tile {
  const [lowerLeft, lowerRight, upperLeft] = tile.corners;
  return { ...tile, corners: [add(lowerLeft, by), add(lowerRight, by), add(upperLeft, by)] };
}

/** The shift nearest to `by` at which an edge of the tile meets one of another's, where one is within `within` metres; seen from
 * the front. */
export function snapped(tile: Tile, others: readonly Tile[], by: Point, within: number): Point {
  const own = bounds([tile]);
  const along = (axis: 0 | 1) => {
    const mine = [own.low[axis], own.high[axis]].map((edge) => edge + by[axis]);
    const theirs = others.flatMap((other) => {
      const { low, high } = bounds([other]);
      return [low[axis], high[axis]];
    });
    const gaps = mine.flatMap((edge) => theirs.map((other) => other - edge)).filter((gap) => Math.abs(gap) <= within);
    const least = gaps.reduce((best, gap) => (Math.abs(gap) < Math.abs(best) ? gap : best), Infinity);
    return by[axis] + (Number.isFinite(least) ? least : 0);
  };
  return [along(0), along(1), by[2]];
}
