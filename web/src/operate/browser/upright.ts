// Where what moves in a camera's picture stands, and how large it is: an upright plane through its foot that faces the camera, cut by
// its outline's rays. The twin of src/fuse/billboard.rs, upright.rs and src/render/passes/billboard.rs, for what browsers are told.

import type { Point } from "../orbit";
import { type Lens, type Ray, project, ray } from "../../spatial/lens";
import type { Rectangle } from "./foreground";

type Spot = readonly [number, number];
/** What a ray of the world meets. */
export type Meet = (ray: Ray) => { readonly point_m: Point; readonly normal: Point } | null;

/** An upright rectangle in the world. */
export type Upright = {
  readonly foot: Point;
  /** Along its base line, as its camera sees it to the right. */
  readonly right: Point;
  readonly halfWidth: number;
  readonly height: number;
  /** Whether the picture's border cuts it elsewhere than at its head. */
  readonly isCut: boolean;
};

const LEAST_M = 0.05;
const MOST_M = 30;
/** Lines of an outline that are cut with the plane, at most. */
const MOST_LINES = 48;
/** Nearer than this to the camera's nadir an upright plane faces nowhere. */
const NADIR_M = 0.05;
/** Steeper is a wall. */
const LEAST_LEVEL = Math.SQRT1_2;

const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = ({ origin, direction }: Ray, reach: number): Point =>
  [origin[0] + direction[0] * reach, origin[1] + direction[1] * reach, origin[2] + direction[2] * reach];

type Line = { readonly ends: readonly [Spot, Spot]; readonly top: Spot; readonly bottom: Spot };
export type Down = "below" | "above" | "left" | "right";

/** Which side of the picture is down at a texture coordinate: under a ceiling camera people lie. */
export function downAt(lens: Lens, at: Spot, size: Spot): Down {
  const through = ray(lens, at);
  const from = through && along(through, 10);
  const [high, low] = from ? [project(lens, from), project(lens, [from[0], from[1], from[2] - 0.01])] : [null, null];
  if (!high || !low) return "below";
  const [x, y] = [(low.u - high.u) * size[0], (low.v - high.v) * size[1]];
  if (Math.abs(y) >= Math.abs(x)) return y < 0 ? "above" : "below";
  return x < 0 ? "left" : "right";
}

/** The rectangle's line that is `nth` from above, pixels of the whole picture; null where nothing moves in it. */
function lineOf({ left, top, width, height, mask }: Rectangle, down: Down, nth: number): Line | null {
  const isSideways = down === "left" || down === "right";
  const [across, lines] = isSideways ? [height, width] : [width, height];
  const line = down === "above" || down === "left" ? lines - 1 - nth : nth;
  const moves = (i: number) => (isSideways ? mask[i * width + line] : mask[line * width + i]) === 255;
  let [first, last] = [0, across - 1];
  while (first < across && !moves(first)) first += 1;
  if (first === across) return null;
  while (!moves(last)) last -= 1;
  const place = (i: number, l: number): Spot => (isSideways ? [left + l, top + i] : [left + i, top + l]);
  const [upper, lower] = down === "above" || down === "left" ? [line + 1, line] : [line, line + 1];
  const middle = (first + last + 1) / 2;
  return { ends: [place(first, line + 0.5), place(last + 1, line + 0.5)], top: place(middle, upper), bottom: place(middle, lower) };
}

/** Where a place of the picture touches what one can stand on: before a wall that is met first, its foot. */
export function groundPoint(lens: Lens, at: Spot, meet: Meet): Point | null {
  const through = ray(lens, at);
  const hit = through && meet(through);
  if (!hit) return null;
  if (hit.normal[2] >= LEAST_LEVEL) return hit.point_m;
  if (hit.normal[2] <= -LEAST_LEVEL) return null;
  const [x, y, z] = hit.point_m;
  const [nx, ny, nz] = hit.normal;
  return meet({ origin: [x + nx * 0.05, y + ny * 0.05, z + nz * 0.05], direction: [0, 0, -1] })?.point_m ?? null;
}

/** What stands where a rectangle of a picture of `size` pixels moves; null where its foot meets nothing, or is no sound size. */
export function uprightOf(lens: Lens, size: Spot, rectangle: Rectangle, meet: Meet): Upright | null {
  const { left, top, width, height } = rectangle;
  const texture = ([x, y]: Spot): Spot => [x / size[0], y / size[1]];
  const down = downAt(lens, texture([left + width / 2, top + height / 2]), size);
  const count = down === "left" || down === "right" ? width : height;
  let lowest: Line | null = null;
  for (let nth = count - 1; nth >= 0 && !lowest; nth -= 1) lowest = lineOf(rectangle, down, nth);
  const contact = lowest && groundPoint(lens, texture(lowest.bottom), meet);
  if (!contact) return null;
  const away = minus(contact, lens.position);
  const level = Math.hypot(away[0], away[1]);
  if (level < NADIR_M) return null;
  const right: Point = [away[1] / level, -away[0] / level, 0];
  const facing: Point = [-away[0] / level, -away[1] / level, 0];
  const cut = (at: Spot): Spot | null => {
    const through = ray(lens, texture(at));
    if (!through) return null;
    const slope = dot(through.direction, facing);
    const reach = dot(minus(contact, through.origin), facing) / slope;
    if (!(reach > 0) || !Number.isFinite(reach)) return null;
    const from = minus(along(through, reach), contact);
    return [dot(from, right), from[2]];
  };
  let [least, most, high] = [Infinity, -Infinity, -Infinity];
  for (let nth = 0; nth < count; nth += Math.max(1, Math.ceil(count / MOST_LINES))) {
    const line = lineOf(rectangle, down, nth);
    if (!line) continue;
    for (const end of line.ends) {
      const met = cut(end);
      if (met) [least, most] = [Math.min(least, met[0]), Math.max(most, met[0])];
    }
    high = Math.max(high, cut(line.top)?.[1] ?? -Infinity);
  }
  const isSound = (extent: number) => extent >= LEAST_M && extent <= MOST_M;
  if (!isSound(most - least) || !isSound(high)) return null;
  const middle = (least + most) / 2;
  return {
    foot: [contact[0] + right[0] * middle, contact[1] + right[1] * middle, contact[2]],
    right,
    halfWidth: (most - least) / 2,
    height: high,
    isCut: isCut(rectangle, size, down),
  };
}

function isCut({ left, top, width, height }: Rectangle, size: Spot, down: Down): boolean {
  const at = { left: left === 0, above: top === 0, right: left + width >= size[0], below: top + height >= size[1] };
  const head = { below: "above", above: "below", left: "right", right: "left" } as const;
  return (Object.keys(at) as (keyof typeof at)[]).some((side) => side !== head[down] && at[side]);
}

const UNTURNED_RAD = Math.PI / 3;
const UPRIGHT_RAD = Math.PI / 4;

/** The directions of base line and sides, turned towards the viewer: at most as much as is needed so that it neither vanishes edge-on
 * nor from above, where it leans back. */
export function turnedTowards(right: Point, foot: Point, eye: Point): readonly [Point, Point] {
  const to = minus(eye, foot);
  const length = Math.hypot(...to) || 1;
  const level = Math.hypot(to[0], to[1]);
  const towards: Spot = level > 1e-9 ? [to[0] / level, to[1] / level] : [-right[1], right[0]];
  const steepness = Math.max(0, Math.asin(Math.min(1, Math.max(-1, to[2] / length))) - UPRIGHT_RAD);
  const unturned = UNTURNED_RAD * Math.max(0, 1 - steepness / UPRIGHT_RAD);
  const ahead = towards[0] * right[1] - towards[1] * right[0];
  const sideways = (towards[0] * right[0] + towards[1] * right[1]) * (Math.sign(ahead) || 1);
  const angle = Math.atan2(sideways, Math.abs(ahead));
  const excess = Math.sign(angle) * Math.max(0, Math.abs(angle) - unturned);
  const [sine, cosine] = [Math.sin(excess), Math.cos(excess)];
  const turned: Point = [right[0] * cosine - right[1] * sine, right[0] * sine + right[1] * cosine, 0];
  const front: Spot = [turned[1], -turned[0]];
  const back = front[0] * towards[0] + front[1] * towards[1] <= 0 ? 1 : -1;
  const [lean, rise] = [Math.sin(steepness) * back, Math.cos(steepness)];
  return [turned, [front[0] * lean, front[1] * lean, rise]];
}
