// Outlines, pictures and places on the earth: the arithmetic of the ground.

import { expect, test } from "vitest";
import { mapOf } from "../../spatial/planeMap";
import { hundredMetres, onEarth, readPlace } from "./earth";
import { applied, byLength, byNorth, described, laidOut, moved, movedImagery, pixelAt, residual, worldFromPixel } from "./placement";
import { area, crosses, isInside, rectangle, withCorner, withCornerAfter, withoutCorner } from "./polygon";

test("an outline keeps its shape while corners come and go", () => {
  const start = rectangle(40, 20, [5, 0]);
  expect(start).toEqual([[-15, -10], [25, -10], [25, 10], [-15, 10]]);
  expect(area(start)).toBe(800);
  const more = withCornerAfter(start, 3);
  expect(more[4]).toEqual([-15, 0]);
  expect(area(withCorner(more, 4, [-20, 0.00049]))).toBeCloseTo(850);
  expect(withoutCorner(more, 4)).toEqual(start);
  expect(withoutCorner(start.slice(0, 3), 0)).toHaveLength(3);
  expect([isInside(start, [0, 0]), isInside(start, [26, 0])]).toEqual([true, false]);
});

test("an outline that crosses itself is told", () => {
  expect(crosses(rectangle(4, 4))).toBe(false);
  expect(crosses([[0, 0], [4, 4], [4, 0], [0, 4]])).toBe(true);
  expect(crosses([[0, 0], [4, 0], [2, 1], [2, 4]])).toBe(false);
});

const SIZE = [400, 200] as const;
const rowsOf = (imagery: ReturnType<typeof laidOut>) => {
  const map = mapOf(imagery, SIZE, undefined);
  const rows = map && worldFromPixel(map, SIZE);
  if (!rows) throw new Error("no map");
  return { map, rows };
};

test("a picture is laid out with north up", () => {
  const imagery = laidOut("assets/a.png", SIZE, 0.1, [5, -3]);
  const { map, rows } = rowsOf(imagery);
  expect(applied(rows, [0, 0])).toEqual([expect.closeTo(-15), expect.closeTo(7)]);
  expect(applied(rows, [400, 200])).toEqual([expect.closeTo(25), expect.closeTo(-13)]);
  expect(pixelAt(map, SIZE, [5, -3])).toEqual([expect.closeTo(200), expect.closeTo(100)]);
  const words = described(rows, SIZE);
  expect(words.metresPerPixel).toBeCloseTo(0.1);
  expect(words.turnDeg).toBeCloseTo(0);
  expect(residual(rows, imagery)).toBeCloseTo(0);
});

test("a known length and a north arrow place a picture, and what they were drawn from stays", () => {
  const start = laidOut("assets/a.png", SIZE, 0.1, [0, 0]);
  const before = rowsOf(start).rows;
  // On the picture a line from pixel (100, 50) to (300, 50) is really 30 m long, and its right is north.
  const [from, to] = [applied(before, [100, 50]), applied(before, [300, 50])];
  const length = byLength(from, to, 30);
  const north = byNorth(from, to);
  if (!length || !north) throw new Error("no move");
  const after = movedImagery(movedImagery(start, length), north);
  const { rows } = rowsOf(after);
  expect(applied(rows, [100, 50])).toEqual([expect.closeTo(from[0]), expect.closeTo(from[1])]);
  expect(applied(rows, [300, 50])).toEqual([expect.closeTo(from[0], 3), expect.closeTo(from[1] + 30, 3)]);
  const words = described(rows, SIZE);
  expect(words.metresPerPixel).toBeCloseTo(0.15);
  expect(words.turnDeg).toBeCloseTo(90);
  expect(byLength(from, from, 3)).toBeNull();
  expect(byNorth(from, from)).toBeNull();
});

test("moves keep shapes", () => {
  const move = { about: [1, 2] as const, factor: 2, turnDeg: 90, shift: [10, 0] as const };
  expect(moved([1, 2], move)).toEqual([11, 2]);
  expect(moved([2, 2], move)).toEqual([expect.closeTo(11), expect.closeTo(4)]);
});

test("metres become degrees as the daemon has them", () => {
  const origin = { latitude_deg: 52.0903, longitude_deg: 5.1212 };
  const { longitudeDeg, latitudeDeg } = hundredMetres(origin);
  // One degree there is 111.26 km to the north and 68.5 km to the east.
  expect(100 / latitudeDeg / 1e3).toBeCloseTo(111.26, 1);
  expect(100 / longitudeDeg / 1e3).toBeCloseTo(68.5, 1);
  const [west, east] = [onEarth(origin, [-50, 0]), onEarth(origin, [50, 0])];
  const [south, north] = [onEarth(origin, [0, -25]), onEarth(origin, [0, 25])];
  const bounds = { west_deg: west.longitude_deg, east_deg: east.longitude_deg, south_deg: south.latitude_deg, north_deg: north.latitude_deg };
  const map = mapOf({ file: "a.png", bounds }, SIZE, origin);
  const rows = map && worldFromPixel(map, SIZE);
  if (!rows) throw new Error("no map");
  expect(applied(rows, [0, 100])).toEqual([expect.closeTo(-50, 1), expect.closeTo(0, 1)]);
  expect(applied(rows, [200, 0])).toEqual([expect.closeTo(0, 1), expect.closeTo(25, 1)]);
});

test("places are read as maps print them", () => {
  expect(readPlace("52.0903, 5.1212")).toEqual({ latitude_deg: 52.0903, longitude_deg: 5.1212 });
  expect(readPlace("-33.85 151.2")).toEqual({ latitude_deg: -33.85, longitude_deg: 151.2 });
  expect(readPlace("52°5'24\"N, 5°7'30\"W")?.longitude_deg).toBeCloseTo(-5.125);
  expect(readPlace("152.1, 5")).toBeNull();
  expect(readPlace("here")).toBeNull();
});
