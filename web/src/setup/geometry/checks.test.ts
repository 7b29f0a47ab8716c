// What the daemon would refuse is told at its field.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { checks } from "./checks";

const of = (document: Omit<SceneDocument, "version">) => checks({ version: 1, ...document }).map(({ id, field, key }) => `${id} ${field} ${key}`);

test("what is right is told of nothing", () => {
  expect(of({
    boxes: [{ id: "hall", center_m: [0, 0, 1], size_m: [1, 1, 2], yaw_deg: -360, texture: { file: "assets/brick.png", size_m: [1, 1] } }],
    cylinders: [{ id: "tank", base_m: [0, 0, 0], radius_m: 0.001, height_m: 1e5 }],
    footprints: [{ id: "house", polygon: [[0, 0], [1, 0], [0, 1]], top_m: 3 }],
    models: [{ id: "kiosk", file: "kiosk.glb" }],
  })).toEqual([]);
});

test("numbers out of range", () => {
  expect(of({ boxes: [{ id: "hall", center_m: [0, 2e8, 1], size_m: [1, 0, 2], yaw_deg: 361 }] })).toEqual(["hall center_m/1 far", "hall size_m/1 extent", "hall yaw_deg turn"]);
  expect(of({ cylinders: [{ id: "tank", base_m: [0, 0, 0], radius_m: 2e5, height_m: NaN }] })).toEqual(["tank radius_m extent", "tank height_m extent"]);
  expect(of({ models: [{ id: "kiosk", file: "a.glb", scale: 0 }] })).toEqual(["kiosk scale scale"]);
});

test("ids are unique among all kinds", () => {
  const box = { center_m: [0, 0, 0], size_m: [1, 1, 1] };
  expect(of({ boxes: [{ id: "one", ...box }, { id: "One", ...box }], cylinders: [{ id: "one", base_m: [0, 0, 0], radius_m: 1, height_m: 1 }] }))
    .toEqual(["One id id", "one id taken"]);
});

test("outlines that cross, repeat, have no area or too few corners", () => {
  const house = (polygon: number[][], top_m = 3) => of({ footprints: [{ id: "house", polygon, top_m }] });
  expect(house([[0, 0], [4, 4], [4, 0], [0, 4]])).toEqual(["house polygon/2 crossing"]);
  expect(house([[0, 0], [1, 0], [1, 0], [0, 1]])).toEqual(["house polygon/2 repeat"]);
  expect(house([[0, 0], [1, 0], [2, 0]])).toEqual(["house polygon area"]);
  expect(house([[0, 0], [1, 0]])).toEqual(["house polygon corners"]);
  expect(house([[0, 0], [1, 0], [0, 1]], 0)).toEqual(["house top_m heights"]);
});

test("pictures repeat at most so often", () => {
  const box = { id: "hall", center_m: [0, 0, 0], size_m: [100, 1, 1] };
  expect(of({ boxes: [{ ...box, texture: { file: "a.png", size_m: [0.01, 1] } }] })).toEqual(["hall texture/size_m repeats"]);
  expect(of({ boxes: [{ ...box, roof_texture: { file: "a.png", size_m: [0, 1] } }] })).toEqual(["hall roof_texture/size_m/0 extent"]);
});
