// Tiles stand where the daemon puts them (src/wall/surface.rs), and rectangles are said and placed alike.

import { expect, test } from "vitest";
import { newWall, planeOf, printWall, readWall, seenFrom, windowOf } from "./document";
import { type Surface, converted, stepOf, tilesOf, usualViewer } from "./layout";
import { cornersOf, placingOf, snapped } from "./placing";

const GRID: Surface = { kind: "grid", columns: 3, rows: 2, tile_px: [160, 90], tile_m: [1.6, 0.9], gap_m: [0.1, -0.09] };

const close = (a: readonly number[] | undefined, b: readonly number[]) => {
  expect(a?.length).toBe(b.length);
  b.forEach((value, i) => expect(a?.[i]).toBeCloseTo(value, 6));
};

test("a grid's tiles stand about the middle, from the upper left", () => {
  const tiles = tilesOf(GRID);
  expect(tiles.map(({ id }) => id)).toEqual(["r1c1", "r1c2", "r1c3", "r2c1", "r2c2", "r2c3"]);
  close(tiles[0]?.corners[0], [-2.5, -0.045, 0]);
  close(tiles[5]?.corners[2], [0.9, 0.045, 0]);
  expect(tiles[0]?.blend_px).toEqual([0, 0, 0, 9]);
  close(usualViewer(GRID), [0, 0, 1.5 * 1.71]);
});

test("a cylinder's tiles stand around its axis, their edges at the radius", () => {
  const cylinder = { kind: "cylinder", columns: 5, rows: 1, tile_px: [100, 100], tile_m: [1, 1], gap_m: [0.1, 0], radius_m: 2 } as const;
  for (const { corners } of tilesOf(cylinder)) {
    expect(Math.hypot(corners[0][0], corners[0][2])).toBeCloseTo(2, 9);
    expect(Math.hypot(corners[1][0], corners[1][2])).toBeCloseTo(2, 9);
  }
  const [first, last] = [tilesOf(cylinder)[0], tilesOf(cylinder)[4]];
  expect(first?.corners[0][0]).toBeLessThan(0);
  close(first?.corners[0], [-(last?.corners[1][0] ?? 0), -0.5, last?.corners[1][2] ?? 0]);
  expect(stepOf(cylinder)).toBeCloseTo(2 * Math.asin(0.25) + 2 * Math.asin(0.025), 9);
});

test("a rectangle is where its placing says, and says its placing", () => {
  const placing = { middle: [1, 2, -3] as const, width: 1.2, height: 0.7, yaw: 30, pitch: -10, roll: 5 };
  const corners = cornersOf(placing);
  const back = placingOf(corners);
  close([...back.middle, back.width, back.height, back.yaw, back.pitch, back.roll], [1, 2, -3, 1.2, 0.7, 30, -10, 5].map((value) => value));
  // The middle tile of a cylinder faces the viewer; one to the right is turned towards the left.
  const right = tilesOf({ kind: "cylinder", columns: 2, rows: 1, tile_px: [16, 16], tile_m: [1, 1], gap_m: [0, 0], radius_m: 2 })[1];
  expect(placingOf(right?.corners ?? corners).yaw).toBeLessThan(0);
});

test("edges snap to those of neighbours", () => {
  const [first, second] = tilesOf(GRID);
  if (!first || !second) throw new Error("no tiles");
  close(snapped(second, [first], [-0.08, 0.001, 0], 0.05), [-0.1, 0, 0]);
  close(snapped(second, [first], [0.3, 0.2, 0], 0.05), [0.3, 0.2, 0]);
});

test("a wall is read and printed alike, and converted without moving its tiles", () => {
  const wall = { ...newWall("plaza", null), surface: GRID };
  expect(readWall(printWall(wall))).toEqual(wall);
  expect(readWall({ ...printWall(wall), viewer_m: [0, 0, 1.5 * 1.71] }).viewer_m).toBeNull();
  const free = converted(GRID, "tiles");
  expect(tilesOf(free)).toEqual(tilesOf(GRID));
  expect(readWall(printWall({ ...wall, surface: free })).surface).toEqual(free);
  expect(converted(converted(GRID, "cylinder"), "grid")).toEqual(GRID);
});

test("windows stand before the eye as the wall before its viewer", () => {
  // The daemon's own answer for docs/api.md's wall: the eye looks north, 1.5 heights before the wall.
  const wall = { ...newWall("plaza", null), eye_m: [0, 0, 5] as const, target_m: [0, 10, 5] as const, surface: GRID };
  const plane = planeOf(GRID);
  if (!plane) throw new Error("a grid has a plane");
  const corners = windowOf(wall, plane.corners);
  close(corners[0], [-2.5, 1.5 * 1.71, 5 - 0.855]);
  close(corners[2], [-2.5, 1.5 * 1.71, 5 + 0.855]);
  close(windowOf({ ...wall, zoom: 2 }, plane.corners)[1], [1.25, 1.5 * 1.71, 5 - 0.4275]);
  // A view's height is the wall's height.
  const seen = seenFrom(wall, { eye: [0, 0, 5], target: [0, 10, 5], fov: 60 });
  expect(seen.zoom).toBeCloseTo(1 / 3 / Math.tan(Math.PI / 6), 3);
});
