// What a ray meets first, and what lies below a place: by the things' extents, which is what people grasp. Models count as the
// prism over their extent.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import type { Corner } from "../plan/frame";
import type { Ray } from "./eye";
import { type Outline, corner, edges, isInside } from "./outline";
import { type Extent, type FileExtents, type HeightField, extentOf, things } from "./things";

/** `id`: of the thing; null of ground. */
export type Met = { readonly id: string | null; readonly at: Point; readonly distance: number };
export type Among = { readonly except?: ReadonlySet<string>; readonly files?: FileExtents };

const at = ({ from, along }: Ray, distance: number): Point =>
  [from[0] + along[0] * distance, from[1] + along[1] * distance, from[2] + along[2] * distance];

function levelDistance(ray: Ray, outline: Outline, height: number): number {
  if (Math.abs(ray.along[2]) < 1e-12) return Infinity;
  const distance = (height - ray.from[2]) / ray.along[2];
  if (!(distance > 0)) return Infinity;
  const [x, y] = at(ray, distance);
  return isInside(outline, [x, y]) ? distance : Infinity;
}

function wallDistance(ray: Ray, [a, b]: readonly [Corner, Corner], { low, high }: Extent): number {
  const [ex, ey] = [b[0] - a[0], b[1] - a[1]];
  const across = ray.along[0] * ey - ray.along[1] * ex;
  if (Math.abs(across) < 1e-12) return Infinity;
  const [dx, dy] = [a[0] - ray.from[0], a[1] - ray.from[1]];
  const distance = (dx * ey - dy * ex) / across;
  const share = (dx * ray.along[1] - dy * ray.along[0]) / across;
  const height = ray.from[2] + ray.along[2] * distance;
  return distance > 0 && share >= 0 && share <= 1 && height >= low && height <= high ? distance : Infinity;
}

/** How far away a ray meets a prism; infinitely where it misses. */
export function prismDistance(ray: Ray, extent: Extent): number {
  return Math.min(
    levelDistance(ray, extent.outline, extent.high),
    levelDistance(ray, extent.outline, extent.low),
    ...edges(extent.outline).map((edge) => wallDistance(ray, edge, extent)),
  );
}

/** The height of uneven ground at a place; null beside it. A cell is two triangles, split from south-west to north-east. */
export function fieldHeight({ low_m, step_m, columns, heights_m }: HeightField, place: Corner): number | null {
  const rows = Math.floor(heights_m.length / columns);
  const low = corner(low_m);
  const [x, y] = [(place[0] - low[0]) / step_m, (place[1] - low[1]) / step_m];
  if (!(x >= 0 && y >= 0 && x <= columns - 1 && y <= rows - 1)) return null;
  const [column, row] = [Math.min(Math.floor(x), columns - 2), Math.min(Math.floor(y), rows - 2)];
  const post = (dx: number, dy: number) => heights_m[(row + dy) * columns + column + dx] ?? 0;
  const [u, v] = [x - column, y - row];
  const [a, c] = [post(0, 0), post(1, 1)];
  return u > v ? a + u * (post(1, 0) - a) + v * (c - post(1, 0)) : a + v * (post(0, 1) - a) + u * (c - post(0, 1));
}

function fieldDistance(ray: Ray, field: HeightField, extent: Extent): number {
  if (Math.abs(ray.along[2]) > 1 - 1e-9) {
    const height = fieldHeight(field, [ray.from[0], ray.from[1]]);
    return height === null ? Infinity : (height - ray.from[2]) / ray.along[2];
  }
  const far = Math.hypot(ray.from[0] - extent.middle[0], ray.from[1] - extent.middle[1]) + field.step_m * field.heights_m.length ** 0.5 * 2;
  // So fine that no cell is passed over.
  const step = field.step_m / 2;
  for (let distance = 0; distance < far; distance += step) {
    const [x, y, z] = at(ray, distance);
    const height = fieldHeight(field, [x, y]);
    if (height !== null && z <= height) return distance;
  }
  return Infinity;
}

/** What a ray meets first; null where it meets nothing. */
export function meet(document: SceneDocument, ray: Ray, { except, files }: Among = {}): Met | null {
  let [nearest, id]: [number, string | null] = [Infinity, null];
  for (const { polygon, height_m = 0 } of document.ground ?? []) {
    nearest = Math.min(nearest, levelDistance(ray, polygon.map(corner), height_m));
  }
  for (const one of things(document)) {
    if (except?.has(one.of.id)) continue;
    const extent = extentOf(one, files);
    const distance = one.list === "height_fields" ? fieldDistance(ray, one.of, extent) : prismDistance(ray, extent);
    if (distance < nearest) [nearest, id] = [distance, one.of.id];
  }
  return nearest === Infinity ? null : { id, at: at(ray, nearest), distance: nearest };
}

/** What something at a place stands on: the highest below it, with its height; height 0 over nothing. */
export function support(document: SceneDocument, place: Corner, among: Among = {}): { height: number; id: string | null } {
  const met = meet(document, { from: [place[0], place[1], 1e5], along: [0, 0, -1] }, among);
  return met ? { height: Number(met.at[2].toFixed(4)), id: met.id } : { height: 0, id: null };
}
