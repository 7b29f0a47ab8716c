import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { mostUseful, weight } from "./choosing";
import { type Calibration, lensOf } from "./lens";

const plaza = JSON.parse(readFileSync("../config/demo/plaza.json", "utf8")) as { cameras: { id: string; calibration: Calibration }[] };
const cameras = plaza.cameras.map(({ id, calibration }) => ({ id, lens: lensOf(calibration) }));
const places = [[0, 0, 0], [4, 2, 0], [-4, -2, 0]].map((point) => ({ point: point as [number, number, number], normal: [0, 0, 1] as const }));

test("all are taken where they fit", () => {
  expect(mostUseful(cameras, [-10, -10, 5], places)).toHaveLength(3);
});

test("else those that look the viewer's way", () => {
  expect(mostUseful(cameras, [-14, -12, 6], places, 1).map(({ id }) => id)).toEqual(["west"]);
  expect(mostUseful(cameras, [15, -12, 6], places, 1).map(({ id }) => id)).toEqual(["east"]);
});

test("what a camera does not see it has no say in", () => {
  const [west] = cameras;
  expect(west && weight(west.lens, [-30, -30, 0], [0, 0, 1], [0, 0, 5])).toBe(0);
  expect(west && weight(west.lens, [0, 0, 0], [0, 0, -1], [0, 0, 5])).toBe(0);
});
