// What is wrong with a wall, told at its place while it is edited: the daemon's own rules (src/wall/document.rs and surface.rs),
// which it holds to again when the wall is kept.

import { say } from "../strings";
import { type Wall, viewerOf } from "./document";
import { type Corners, type Grid, MOST_TILES, type Surface, cross, dot, minus, stepOf, tilesOf } from "./layout";

/** By JSON pointer into the wall's document. */
export type Faults = ReadonlyMap<string, string>;

const ID = /^[a-z0-9][a-z0-9_-]{0,63}$/;
const SIDE_PX = [16, 16_384] as const;
const MOST_TILE_PIXELS = 33_177_600;
const SIDE_M = [0.01, 100] as const;
const MOST_WALL_M = 1_000;
const MOST_WORLD_M = 1e7;

export const isId = (text: string) => ID.test(text);

type Tell = (pointer: string, text: string) => void;

function checkRange(tell: Tell, pointer: string, value: number, [least, most]: readonly [number, number], unit = ""): boolean {
  const isWithin = value >= least && value <= most;
  if (!isWithin) tell(pointer, say("wall.fault.range", { least, most, unit }));
  return isWithin;
}

function checkSizePx(tell: Tell, pointer: string, [columns, rows]: readonly [number, number]): void {
  [columns, rows].forEach((side, axis) => checkRange(tell, `${pointer}/${axis}`, side, SIDE_PX, " px"));
  if (columns * rows > MOST_TILE_PIXELS) tell(`${pointer}/0`, say("wall.fault.pixels", { most: MOST_TILE_PIXELS }));
}

function checkGrid(tell: Tell, place: string, grid: Grid): void {
  if (grid.columns < 1) tell(`${place}/columns`, say("wall.fault.count"));
  if (grid.rows < 1) tell(`${place}/rows`, say("wall.fault.count"));
  if (grid.columns * grid.rows > MOST_TILES) tell(`${place}/columns`, say("wall.fault.tiles", { most: MOST_TILES }));
  checkSizePx(tell, `${place}/tile_px`, grid.tile_px);
  for (const axis of [0, 1] as const) {
    const side = grid.tile_m[axis];
    if (!checkRange(tell, `${place}/tile_m/${axis}`, side, SIDE_M, " m")) continue;
    if (grid.gap_m[axis] < -side / 2) tell(`${place}/gap_m/${axis}`, say("wall.fault.overlap", { least: -side / 2 }));
    if (grid.gap_m[axis] > SIDE_M[1]) tell(`${place}/gap_m/${axis}`, say("wall.fault.range", { least: -side / 2, most: SIDE_M[1], unit: " m" }));
  }
}

function checkCylinder(tell: Tell, cylinder: Grid & { radius_m: number }): void {
  const place = "/surface/cylinder";
  checkGrid(tell, place, cylinder);
  const least = 0.51 * cylinder.tile_m[0] + Math.max(cylinder.gap_m[0], 0);
  if (!(cylinder.radius_m >= least && cylinder.radius_m <= MOST_WALL_M)) {
    tell(`${place}/radius_m`, say("wall.fault.radius", { least: Math.ceil(least * 1e3) / 1e3, most: MOST_WALL_M }));
  } else if (stepOf(cylinder) * cylinder.columns > 2 * Math.PI + 1e-6) {
    tell(`${place}/columns`, say("wall.fault.around", { columns: cylinder.columns }));
  }
}

function checkTiles(tell: Tell, { tiles }: Surface & { kind: "tiles" }): void {
  if (tiles.length < 1 || tiles.length > MOST_TILES) tell("/surface/tiles", say("wall.fault.tiles", { most: MOST_TILES }));
  tiles.forEach(({ id, size_px, blend_px }, i) => {
    const place = `/surface/tiles/${i}`;
    if (!isId(id)) tell(`${place}/id`, say("wall.fault.id"));
    else if (tiles.findIndex((other) => other.id === id) < i) tell(`${place}/id`, say("wall.fault.twice", { id }));
    checkSizePx(tell, `${place}/size_px`, size_px);
    blend_px.forEach((blend, edge) => {
      const most = Math.floor(size_px[edge < 2 ? 0 : 1] / 2);
      if (blend < 0 || blend > most) tell(`${place}/blend_px/${edge}`, say("wall.fault.range", { least: 0, most, unit: " px" }));
    });
  });
}

/** Whether a rectangle, as it is shown, turns its front to the viewer. */
function facesViewer(wall: Wall, corners: Corners): boolean {
  const viewer = viewerOf(wall);
  const [lowerLeft, lowerRight, upperLeft] = corners.map((corner) => {
    const [x, y, z] = minus(corner, viewer);
    return [x / wall.zoom, y / wall.zoom, z] as const;
  }) as unknown as Corners;
  const [across, upwards] = [minus(lowerRight, lowerLeft), minus(upperLeft, lowerLeft)];
  const area = cross(across, upwards);
  const distance = -dot(lowerLeft, area) / Math.max(Math.hypot(...area), 1e-12);
  return distance >= 1e-6 * Math.max(Math.hypot(...across), Math.hypot(...upwards));
}

/** All faults of a wall and of its id. */
export function check(id: string, wall: Wall, others: readonly string[] = []): Faults {
  const found = new Map<string, string>();
  const tell: Tell = (pointer, text) => {
    if (!found.has(pointer)) found.set(pointer, text);
  };
  if (!isId(id)) tell("/id", say("wall.fault.id"));
  else if (others.includes(id)) tell("/id", say("wall.fault.taken", { id }));
  if (Array.from(wall.name).length > 200) tell("/name", say("wall.fault.long", { most: 200 }));
  if (wall.parameters.length > 1024) tell("/parameters", say("wall.fault.long", { most: 1024 }));
  checkRange(tell, "/rate_hz", wall.rate_hz, [0.5, 60]);
  checkRange(tell, "/zoom", wall.zoom, [0.01, 100]);
  for (const [key, point] of [["eye_m", wall.eye_m], ["target_m", wall.target_m]] as const) {
    point.forEach((value, axis) => checkRange(tell, `/view/${key}/${axis}`, value, [-MOST_WORLD_M, MOST_WORLD_M], " m"));
  }
  if (Math.hypot(...minus(wall.eye_m, wall.target_m)) < 1e-6) tell("/view/target_m/0", say("wall.fault.direction"));
  wall.viewer_m?.forEach((value, axis) => checkRange(tell, `/viewer_m/${axis}`, value, [-MOST_WALL_M, MOST_WALL_M], " m"));
  const { surface } = wall;
  if (surface.kind === "grid") checkGrid(tell, "/surface/grid", surface);
  else if (surface.kind === "cylinder") checkCylinder(tell, surface);
  else checkTiles(tell, surface);
  if (found.size === 0) {
    tilesOf(surface).forEach((tile, i) => {
      if (facesViewer(wall, tile.corners)) return;
      const place = surface.kind === "tiles" ? `/surface/tiles/${i}` : "/viewer_m";
      tell(place, say("wall.fault.away", { tile: tile.id }));
    });
  }
  return found;
}
