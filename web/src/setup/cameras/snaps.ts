// Places of a scene that are easily found in a picture: corners and edges of what stands there, corners of the ground, places that
// the imagery is tied to, and points of a grid. And which of them a pointer means.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import type { Pixel } from "./pairs";
import { add, cross, dot, minus, point } from "./torch";

export type Of = "ground" | "imagery" | "box" | "cylinder" | "footprint" | "grid" | "edge";
/** `name` is the thing's id or number, `corner` counts from 1. */
export type Snap = { readonly of: Of; readonly name: string; readonly corner: number; readonly isTop: boolean; readonly place: Point };
export type Edge = { readonly of: Of; readonly name: string; readonly ends: readonly [Point, Point] };

/** Pixels of the screen within which corners and edges are meant; corners win. */
export const CORNER_REACH_PX = 14;
export const EDGE_REACH_PX = 8;
const GRID_REACH_PX = 9;
const STEPS_M = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500] as const;
const RIM_POINTS = 4;

type Outline = { of: Of; name: string; corners: readonly Point[]; top: readonly Point[]; isRound: boolean };

function corners2(polygon: readonly (readonly number[])[], z: number): Point[] {
  return polygon.map(([x = 0, y = 0]): Point => [x, y, z]);
}

function boxCorners(center: Point, [w = 0, d = 0]: readonly number[], yawDeg: number, z: number): Point[] {
  const [sine, cosine] = [Math.sin((yawDeg * Math.PI) / 180), Math.cos((yawDeg * Math.PI) / 180)];
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([sx = 0, sy = 0]): Point => {
    const [x, y] = [(sx * w) / 2, (sy * d) / 2];
    return [center[0] + x * cosine - y * sine, center[1] + x * sine + y * cosine, z];
  });
}

function rim([x, y]: Point, radius: number, z: number): Point[] {
  return Array.from({ length: RIM_POINTS }, (_, i): Point => {
    const turn = (2 * Math.PI * i) / RIM_POINTS;
    return [x + radius * Math.cos(turn), y + radius * Math.sin(turn), z];
  });
}

/** Outlines of all that stands, each with its upper one. */
function outlines(document: SceneDocument): Outline[] {
  return [
    ...(document.ground ?? []).map(({ polygon, height_m = 0 }, i): Outline =>
      ({ of: "ground", name: String(i + 1), corners: corners2(polygon, height_m), top: [], isRound: false })),
    ...(document.boxes ?? []).map(({ id, center_m, size_m, yaw_deg = 0 }): Outline => {
      const [center, half] = [point(center_m), (size_m[2] ?? 0) / 2];
      const at = (z: number) => boxCorners(center, size_m, yaw_deg, z);
      return { of: "box", name: id, corners: at(center[2] - half), top: at(center[2] + half), isRound: false };
    }),
    ...(document.footprints ?? []).map(({ id, polygon, base_m = 0, top_m }): Outline =>
      ({ of: "footprint", name: id, corners: corners2(polygon, base_m), top: corners2(polygon, top_m), isRound: false })),
    ...(document.cylinders ?? []).map(({ id, base_m, radius_m, height_m }): Outline => {
      const base = point(base_m);
      const at = (z: number) => rim(base, radius_m, z);
      return { of: "cylinder", name: id, corners: at(base[2]), top: at(base[2] + height_m), isRound: true };
    }),
  ];
}

/** All corners of a scene, lower ones first. */
export function corners(document: SceneDocument): Snap[] {
  const found = outlines(document).flatMap(({ of, name, corners, top }) => [
    ...corners.map((place, i): Snap => ({ of, name, corner: i + 1, isTop: false, place })),
    ...top.map((place, i): Snap => ({ of, name, corner: i + 1, isTop: true, place })),
  ]);
  const tied = (document.ground ?? []).flatMap(({ imagery, height_m = 0 }, g) =>
    (imagery?.control_points ?? []).map(({ world: [x = 0, y = 0] }, i): Snap => ({ of: "imagery", name: String(g + 1), corner: i + 1, isTop: false, place: [x, y, height_m] })));
  return [...tied, ...found];
}

/** All edges of a scene. */
export function edges(document: SceneDocument): Edge[] {
  return outlines(document).flatMap(({ of, name, corners, top, isRound }) => {
    const around = (ring: readonly Point[]) => ring.map((a, i): Edge => ({ of, name, ends: [a, ring[(i + 1) % ring.length] ?? a] }));
    if (isRound) return [];
    const upright = top.map((b, i): Edge => ({ of, name, ends: [corners[i] ?? b, b] }));
    return [...around(corners), ...around(top), ...upright];
  });
}

/** The next round step not below a length. */
export function step(atLeast_m: number): number {
  return STEPS_M.find((known) => known >= atLeast_m) ?? 1000;
}

/** The place on a line through `ends`, between them, that is nearest to a line of sight. */
export function alongEdge([a, b]: readonly [Point, Point], origin: Point, direction: Point): Point {
  const along = minus(b, a);
  const normal = cross(direction, cross(along, direction));
  const share = dot(normal, minus(origin, a)) / dot(normal, along);
  return add(a, along, Number.isFinite(share) ? Math.min(Math.max(share, 0), 1) : 0);
}

export type Pointing = {
  /** Where the pointer is, and where a place lies on the screen; null behind the viewer. */
  readonly at: Pixel;
  readonly onScreen: (place: Point) => Pixel | null;
  /** The line of sight through the pointer. */
  readonly origin: Point;
  readonly direction: Point;
  /** What it meets first; null where it meets nothing. */
  readonly met: Point | null;
  /** Whether something stands between the viewer and a place. */
  readonly isHidden?: (place: Point) => boolean;
  /** Distance of the grid's lines; null where it takes no part. */
  readonly grid_m: number | null;
};

const apart = ([ax, ay]: Pixel, b: Pixel | null) => (b ? Math.hypot(b[0] - ax, b[1] - ay) : Infinity);

/** What a pointer means: a corner near it, else an edge, else a point of the grid; null where it is just what it meets. */
export function snapped({ corners: known, edges: lines }: { corners: readonly Snap[]; edges: readonly Edge[] }, pointing: Pointing): Snap | null {
  const { at, onScreen, isHidden = () => false } = pointing;
  const near = known
    .map((snap) => ({ snap, away: apart(at, onScreen(snap.place)) }))
    .filter(({ away }) => away <= CORNER_REACH_PX)
    .sort((a, b) => a.away - b.away)
    .find(({ snap }) => !isHidden(snap.place));
  if (near) return near.snap;
  const onEdge = lines
    .map(({ of, name, ends }) => {
      const place = alongEdge(ends, pointing.origin, pointing.direction);
      return { snap: { of: "edge", name: `${of} ${name}`, corner: 0, isTop: false, place } satisfies Snap, away: apart(at, onScreen(place)) };
    })
    .filter(({ away }) => away <= EDGE_REACH_PX)
    .sort((a, b) => a.away - b.away)
    .find(({ snap }) => !isHidden(snap.place));
  return onEdge?.snap ?? gridPoint(pointing);
}

function gridPoint({ at, onScreen, met, grid_m }: Pointing): Snap | null {
  if (!met || grid_m === null) return null;
  const place: Point = [Math.round(met[0] / grid_m) * grid_m, Math.round(met[1] / grid_m) * grid_m, met[2]];
  return apart(at, onScreen(place)) <= GRID_REACH_PX ? { of: "grid", name: "", corner: 0, isTop: false, place } : null;
}
