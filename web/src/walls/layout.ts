// What a wall's tiles make up, and where each of them stands, as the daemon has it (docs/api.md, "Walls"). Wall space: x to the
// right, y up, z towards the viewer, who looks along -z; metres.

import type { Point } from "../operate/orbit";

export type Pair = readonly [number, number];
/** Pixels at the left, right, top and bottom over which a tile fades out. */
export type Blend = readonly [number, number, number, number];
/** Lower left, lower right and upper left corner as the viewer sees them. */
export type Corners = readonly [Point, Point, Point];

export type Grid = {
  readonly columns: number;
  readonly rows: number;
  readonly tile_px: Pair;
  readonly tile_m: Pair;
  readonly gap_m: Pair;
};
export type Tile = { readonly id: string; readonly size_px: Pair; readonly corners: Corners; readonly blend_px: Blend };
export type Surface =
  | ({ readonly kind: "grid" } & Grid)
  | ({ readonly kind: "cylinder"; readonly radius_m: number } & Grid)
  | { readonly kind: "tiles"; readonly tiles: readonly Tile[] };
export type Kind = Surface["kind"];

/** Most tiles of a wall. */
export const MOST_TILES = 64;
/** Distance of the viewer from a wall that does not say, in heights of the wall. */
const VIEWER_HEIGHTS = 1.5;

export const add = (a: Point, b: Point): Point => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a: Point, by: number): Point => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a: Point, b: Point): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Point, b: Point): Point => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** How far the middle of the `idx`th of `count` tiles is from the middle of all, in steps. */
const fromMiddle = (idx: number, count: number) => idx - (count - 1) / 2;

const bottomOf = ({ rows, tile_m, gap_m }: Grid, row: number) => -fromMiddle(row, rows) * (tile_m[1] + gap_m[1]) - tile_m[1] / 2;

/** Where a tile of a grid stands on a plane; of a cylinder, where it would if it were rolled out. */
function flat(grid: Grid, column: number, row: number): Corners {
  const left = fromMiddle(column, grid.columns) * (grid.tile_m[0] + grid.gap_m[0]) - grid.tile_m[0] / 2;
  const lowerLeft: Point = [left, bottomOf(grid, row), 0];
  return [lowerLeft, add(lowerLeft, [grid.tile_m[0], 0, 0]), add(lowerLeft, [0, grid.tile_m[1], 0])];
}

const angleOf = (chord: number, radius: number) => 2 * Math.asin(Math.min(Math.max(chord / 2 / radius, -1), 1));

/** Angle from one column of a cylinder to the next, radians. */
export function stepOf({ tile_m, gap_m, radius_m }: Grid & { radius_m: number }): number {
  return angleOf(tile_m[0], radius_m) + angleOf(gap_m[0], radius_m);
}

function bent(cylinder: Grid & { radius_m: number }, column: number, row: number): Corners {
  const half = cylinder.tile_m[0] / 2;
  const depth = Math.sqrt(Math.max(cylinder.radius_m ** 2 - half ** 2, 0));
  // To the right means from -z towards +x.
  const angle = fromMiddle(column, cylinder.columns) * stepOf(cylinder);
  const turned = (x: number, y: number, z: number): Point => [
    x * Math.cos(angle) - z * Math.sin(angle), y, x * Math.sin(angle) + z * Math.cos(angle),
  ];
  const lowerLeft = turned(-half, bottomOf(cylinder, row), -depth);
  return [lowerLeft, add(lowerLeft, turned(cylinder.tile_m[0], 0, 0)), add(lowerLeft, [0, cylinder.tile_m[1], 0])];
}

function ofGrid(grid: Grid, isRing: boolean, corners: (column: number, row: number) => Corners): Tile[] {
  if (!(grid.columns >= 1 && grid.rows >= 1) || grid.columns * grid.rows > MOST_TILES) return [];
  const shared = (axis: 0 | 1) => Math.round((Math.max(-grid.gap_m[axis], 0) / grid.tile_m[axis]) * grid.tile_px[axis]);
  const [across, down] = [shared(0), shared(1)];
  return Array.from({ length: grid.rows * grid.columns }, (_, i) => {
    const [row, column] = [Math.floor(i / grid.columns), i % grid.columns];
    return {
      id: `r${row + 1}c${column + 1}`,
      size_px: grid.tile_px,
      corners: corners(column, row),
      blend_px: [
        column > 0 || isRing ? across : 0, column + 1 < grid.columns || isRing ? across : 0,
        row > 0 ? down : 0, row + 1 < grid.rows ? down : 0,
      ],
    };
  });
}

/** The tiles of a surface where they stand; none where its numbers make none. */
export function tilesOf(surface: Surface): readonly Tile[] {
  if (surface.kind === "tiles") return surface.tiles;
  if (surface.kind === "grid") return ofGrid(surface, false, (column, row) => flat(surface, column, row));
  const isRing = stepOf(surface) * surface.columns > 2 * Math.PI - 1e-6;
  return ofGrid(surface, isRing, (column, row) => bent(surface, column, row));
}

/** The tiles as they are drawn from the front: those of a cylinder rolled out, all others as they stand. */
export function frontOf(surface: Surface): readonly Tile[] {
  if (surface.kind !== "cylinder") return tilesOf(surface);
  return ofGrid(surface, false, (column, row) => flat(surface, column, row));
}

export const fourth = ([lowerLeft, lowerRight, upperLeft]: Corners): Point => add(lowerRight, minus(upperLeft, lowerLeft));

/** Least and greatest coordinates of all corners. */
export function bounds(tiles: readonly Tile[]): { low: Point; high: Point } {
  const all = tiles.flatMap(({ corners }) => [...corners, fourth(corners)]);
  const of = (pick: (...values: number[]) => number, axis: 0 | 1 | 2) => (all.length > 0 ? pick(...all.map((point) => point[axis])) : 0);
  const point = (pick: (...values: number[]) => number): Point => [of(pick, 0), of(pick, 1), of(pick, 2)];
  return { low: point(Math.min), high: point(Math.max) };
}

/** Where the viewer of a wall is that does not say. */
export function usualViewer(surface: Surface): Point {
  if (surface.kind === "cylinder") return [0, 0, 0];
  const tiles = tilesOf(surface);
  if (tiles.length === 0) return [0, 0, 1];
  const { low, high } = bounds(tiles);
  const back = VIEWER_HEIGHTS * Math.max(high[1] - low[1], 0.01);
  return [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + back];
}

/** The same tiles as another kind of surface, as far as that can hold them. */
export function converted(surface: Surface, kind: Kind): Surface {
  if (surface.kind === kind) return surface;
  if (kind === "tiles") return { kind, tiles: tilesOf(surface) };
  const grid = surface.kind === "tiles" ? gridAround(surface.tiles) : surface;
  const { columns, rows, tile_px, tile_m, gap_m } = grid;
  const alike = { columns, rows, tile_px, tile_m, gap_m };
  if (kind === "grid") return { kind, ...alike };
  // A third of a circle: a curve that is seen at once, and that any number of columns fits.
  const length = columns * (tile_m[0] + gap_m[0]);
  const radius = Math.max((length * 3) / (2 * Math.PI), tile_m[0] + Math.max(gap_m[0], 0));
  return { kind, ...alike, radius_m: Math.round(radius * 1e3) / 1e3 };
}

/** A grid of as many tiles of the first one's size. */
function gridAround(tiles: readonly Tile[]): Grid {
  const first = tiles[0];
  if (!first) return { columns: 1, rows: 1, tile_px: [1920, 1080], tile_m: [1.2, 0.675], gap_m: [0, 0] };
  const [lowerLeft, lowerRight, upperLeft] = first.corners;
  const length = (a: Point, b: Point) => Math.round(Math.hypot(...minus(a, b)) * 1e4) / 1e4;
  const rows = tiles.length > 3 && tiles.length % 2 === 0 ? 2 : 1;
  return {
    columns: tiles.length / rows, rows, tile_px: first.size_px,
    tile_m: [length(lowerRight, lowerLeft), length(upperLeft, lowerLeft)], gap_m: [0, 0],
  };
}
