// How places of the world and pixels of a picture belong together: from straight above on the map, from somewhere in the view. What
// draws handles and outlines, and what drags them, knows no more than this.

import type { Point, View } from "../../operate/orbit";
import { type Corner, type Frame, toScreen, toWorld } from "../plan/frame";

export type Ray = { readonly from: Point; readonly along: Point };
export type Eye = {
  /** Whether it looks straight down: then heights can be neither seen nor dragged. */
  readonly isLevel: boolean;
  readonly size_px: Corner;
  readonly ray: (at: Corner) => Ray;
  readonly metresPerPx: (place: Point) => number;
  /** What is to be seen of a line through places, in pixels: pieces, since what lies behind the eye is cut off. */
  readonly lines: (places: readonly Point[], isClosed: boolean) => Corner[][];
  /** Where a place is seen; null behind the eye. */
  readonly place: (place: Point) => Corner | null;
};

/** Above everything: scenes end at 1e8 m, and rays from there would lose digits. */
const ABOVE_M = 1e5;
/** What is nearer to the eye is cut off, share of the distance to what it looks at. */
const NEAR = 0.001;

export function planEye(frame: Frame): Eye {
  const place = ([x, y]: Point): Corner => toScreen(frame, [x, y]);
  return {
    isLevel: true,
    size_px: frame.size_px,
    place,
    ray: (at) => ({ from: [...toWorld(frame, at), ABOVE_M], along: [0, 0, -1] }),
    metresPerPx: () => 1 / frame.scale,
    lines: (places, isClosed) => [[...places, ...(isClosed ? places.slice(0, 1) : [])].map(place)],
  };
}

const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a: Point, b: Point): Point => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
function unit(of: Point): Point {
  const length = Math.hypot(...of) || 1;
  return [of[0] / length, of[1] / length, of[2] / length];
}

/** The eye of a view in a picture of so many pixels. */
export function viewEye({ eye, target, fov }: View, size_px: Corner): Eye {
  const forward = unit(minus(target, eye));
  const side = cross(forward, [0, 0, 1]);
  const right = Math.hypot(...side) < 1e-9 ? ([1, 0, 0] as Point) : unit(side);
  const up = cross(right, forward);
  // Pixels by which one unit at one unit's distance is apart.
  const focal = size_px[1] / 2 / Math.tan((fov * Math.PI) / 360);
  const near = Math.max(NEAR * Math.hypot(...minus(target, eye)), 1e-6);
  const inEye = (place: Point): Point => {
    const to = minus(place, eye);
    return [dot(to, right), dot(to, up), dot(to, forward)];
  };
  const onPicture = ([x, y, depth]: Point): Corner => [size_px[0] / 2 + (x / depth) * focal, size_px[1] / 2 - (y / depth) * focal];
  const cut = (a: Point, b: Point): Point => {
    const share = (near - a[2]) / (b[2] - a[2]);
    return [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, near];
  };
  return {
    isLevel: false,
    size_px,
    place: (place) => {
      const seen = inEye(place);
      return seen[2] > near ? onPicture(seen) : null;
    },
    ray: (at) => {
      const [x, y] = [(at[0] - size_px[0] / 2) / focal, (size_px[1] / 2 - at[1]) / focal];
      const along: Point = [forward[0] + right[0] * x + up[0] * y, forward[1] + right[1] * x + up[1] * y, forward[2] + right[2] * x + up[2] * y];
      return { from: eye, along: unit(along) };
    },
    metresPerPx: (place) => Math.max(inEye(place)[2], near) / focal,
    lines: (places, isClosed) => {
      const all = [...places, ...(isClosed ? places.slice(0, 1) : [])].map(inEye);
      const pieces: Corner[][] = [];
      let piece: Corner[] = [];
      all.forEach((to, i) => {
        const from = all[i - 1];
        if (from && from[2] > near !== to[2] > near) {
          piece.push(onPicture(cut(from, to)));
          if (to[2] <= near) {
            pieces.push(piece);
            piece = [];
          }
        }
        if (to[2] > near) piece.push(onPicture(to));
      });
      return [...pieces, piece].filter((one) => one.length > 1);
    },
  };
}

/** Where a ray meets a height; null where it does not, or behind the eye. */
export function onLevel({ from, along }: Ray, height: number): Corner | null {
  if (Math.abs(along[2]) < 1e-9) return null;
  const distance = (height - from[2]) / along[2];
  return distance > 0 ? [from[0] + along[0] * distance, from[1] + along[1] * distance] : null;
}

/** The height at which the upright line through a place is nearest to a ray; null where the ray is upright itself. */
export function onUpright({ from, along }: Ray, [x, y]: Corner): number | null {
  const level = along[0] ** 2 + along[1] ** 2;
  if (level < 1e-9) return null;
  const share = ((x - from[0]) * along[0] + (y - from[1]) * along[1]) / level;
  return from[2] + along[2] * share;
}
