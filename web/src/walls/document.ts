// A wall as it is edited, and as the daemon keeps it.

import type { components } from "../contract.gen";
import type { Point, View } from "../operate/orbit";
import { type Corners, type Grid, type Pair, type Surface, type Tile, add, bounds, cross, minus, tilesOf, times, usualViewer } from "./layout";

export type WallDocument = components["schemas"]["Wall"];

export type Wall = {
  readonly name: string;
  readonly scene: string;
  /** Null is live. */
  readonly playhead: string | null;
  readonly rate_hz: number;
  readonly eye_m: Point;
  readonly target_m: Point;
  /** Null: where the wall's size puts the viewer. */
  readonly viewer_m: Point | null;
  readonly zoom: number;
  readonly parameters: string;
  readonly surface: Surface;
};

const USUAL_RATE_HZ = 10;

const numbers = (values: readonly number[] | null | undefined, count: number) => Array.from({ length: count }, (_, i) => values?.[i] ?? 0);
const point = (values: readonly number[] | null | undefined) => numbers(values, 3) as unknown as Point;
const pair = (values: readonly number[] | null | undefined) => numbers(values, 2) as unknown as Pair;

type Told = WallDocument["surface"];

function readGrid(told: NonNullable<Told["grid"]>): Grid {
  return { columns: told.columns, rows: told.rows, tile_px: pair(told.tile_px), tile_m: pair(told.tile_m), gap_m: pair(told.gap_m) };
}

function readSurface({ grid, cylinder, tiles }: Told): Surface {
  if (grid) return { kind: "grid", ...readGrid(grid) };
  if (cylinder) return { kind: "cylinder", ...readGrid(cylinder), radius_m: cylinder.radius_m };
  const read = (tile: NonNullable<Told["tiles"]>[number]): Tile => ({
    id: tile.id, size_px: pair(tile.size_px),
    corners: [point(tile.lower_left_m), point(tile.lower_right_m), point(tile.upper_left_m)],
    blend_px: numbers(tile.blend_px, 4) as unknown as Tile["blend_px"],
  });
  return { kind: "tiles", tiles: (tiles ?? []).map(read) };
}

function printSurface(surface: Surface): Told {
  const list = (values: readonly number[]) => [...values];
  if (surface.kind === "tiles") {
    return {
      tiles: surface.tiles.map(({ id, size_px, corners: [lowerLeft, lowerRight, upperLeft], blend_px }) => ({
        id, size_px: list(size_px), lower_left_m: list(lowerLeft), lower_right_m: list(lowerRight), upper_left_m: list(upperLeft), blend_px: list(blend_px),
      })),
    };
  }
  const { columns, rows, tile_px, tile_m, gap_m } = surface;
  const grid = { columns, rows, tile_px: list(tile_px), tile_m: list(tile_m), gap_m: list(gap_m) };
  return surface.kind === "grid" ? { grid } : { cylinder: { ...grid, radius_m: surface.radius_m } };
}

/** A wall as the daemon tells it. The viewer's place is always told; the usual one is taken for not said. */
export function readWall(told: WallDocument): Wall {
  const surface = readSurface(told.surface);
  const viewer = told.viewer_m ? point(told.viewer_m) : null;
  const isUsual = viewer !== null && Math.hypot(...minus(viewer, usualViewer(surface))) < 1e-6;
  return {
    name: told.name ?? "", scene: told.scene, playhead: told.playhead ?? null, rate_hz: told.rate_hz ?? USUAL_RATE_HZ,
    eye_m: point(told.view.eye_m), target_m: point(told.view.target_m),
    viewer_m: isUsual ? null : viewer, zoom: told.zoom ?? 1, parameters: told.parameters ?? "", surface,
  };
}

/** A wall as the daemon takes it. */
export function printWall(wall: Wall): WallDocument {
  const { name, scene, playhead, rate_hz, eye_m, target_m, viewer_m, zoom, parameters, surface } = wall;
  return {
    name, scene, rate_hz, zoom, parameters, surface: printSurface(surface),
    view: { eye_m: [...eye_m], target_m: [...target_m] },
    ...(playhead === null ? {} : { playhead }),
    ...(viewer_m ? { viewer_m: [...viewer_m] } : {}),
  };
}

/** A new wall: four full-HD screens of 55 inches. */
export function newWall(scene: string, view: View | null): Wall {
  const wall: Wall = {
    name: "", scene, playhead: null, rate_hz: USUAL_RATE_HZ,
    eye_m: view?.eye ?? [0, -14, 5], target_m: view?.target ?? [0, 2, 1], viewer_m: null, zoom: 1, parameters: "",
    surface: { kind: "grid", columns: 2, rows: 2, tile_px: [1920, 1080], tile_m: [1.21, 0.68], gap_m: [0.004, 0.004] },
  };
  return view ? seenFrom(wall, view) : wall;
}

export const viewerOf = (wall: Wall): Point => wall.viewer_m ?? usualViewer(wall.surface);

/** The wall with a view's eye and target, zoomed so that its height shows what the view's height does. */
export function seenFrom(wall: Wall, { eye, target, fov }: View): Wall {
  const { low, high } = bounds(tilesOf(wall.surface));
  const viewer = viewerOf(wall);
  // Of a cylinder the nearest tiles stand at its radius, of others the front of all.
  const distance = wall.surface.kind === "cylinder" ? wall.surface.radius_m : Math.max(viewer[2] - high[2], 1e-3);
  const half = Math.max(high[1] - low[1], 1e-3) / 2;
  const zoom = half / (distance * Math.tan((fov * Math.PI) / 360));
  const kept = Math.min(Math.max(Math.round(zoom * 1e3) / 1e3, 0.01), 100);
  return { ...wall, eye_m: eye, target_m: target, zoom: kept };
}

/** Where the corners of a rectangle of the wall are in the world: it stands before the eye as it stands before the viewer. */
export function windowOf(wall: Wall, corners: Corners): Corners {
  const [viewer, away] = [viewerOf(wall), minus(wall.target_m, wall.eye_m)];
  const forward = times(away, 1 / Math.max(Math.hypot(...away), 1e-9));
  const level = cross(forward, [0, 0, 1]);
  const side = Math.hypot(...level) > 1e-6 ? level : cross(forward, [0, 1, 0]);
  const right = times(side, 1 / Math.max(Math.hypot(...side), 1e-9));
  const up = cross(right, forward);
  const placed = (corner: Point): Point => {
    const [x, y, z] = minus(corner, viewer);
    return add(wall.eye_m, add(add(times(right, x / wall.zoom), times(up, y / wall.zoom)), times(forward, -z)));
  };
  return [placed(corners[0]), placed(corners[1]), placed(corners[2])];
}

/** The rectangle around all tiles, where they stand in one plane that faces the viewer straight; null where they do not. */
export function planeOf(surface: Surface): { corners: Corners; width: number; height: number } | null {
  const tiles = tilesOf(surface);
  const { low, high } = bounds(tiles);
  const isLevel = (tile: Tile) => {
    const [lowerLeft, lowerRight, upperLeft] = tile.corners;
    return Math.abs(lowerLeft[1] - lowerRight[1]) < 1e-6 && Math.abs(lowerLeft[0] - upperLeft[0]) < 1e-6 && lowerRight[0] > lowerLeft[0];
  };
  if (tiles.length === 0 || high[2] - low[2] > 1e-6 || !tiles.every(isLevel)) return null;
  const corners: Corners = [[low[0], low[1], low[2]], [high[0], low[1], low[2]], [low[0], high[1], low[2]]];
  return { corners, width: high[0] - low[0], height: high[1] - low[1] };
}
