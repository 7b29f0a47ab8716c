// How pairs are judged: by the same camera that clicked them they fit, by another they miss as one sees it.

import { expect, test } from "vitest";
import type { Point } from "../../operate/orbit";
import { lensOf } from "../../spatial/lens";
import type { Calibration, Pair } from "../draft";
import * as p from "./pairs";
import { lookingAt } from "./torch";

const EYE: Point = [-15.5, -11.5, 6.4];
const CAMERA: Calibration = {
  image_size_px: [640, 360], focal_px: [532, 532], center_px: [320, 180], distortion: { model: "none" },
  position_m: [...EYE], world_from_camera: [...lookingAt(EYE, [0, 2, 0], 3, [0, 0, 0, 1])],
};
const LENS = lensOf(CAMERA);
const PLACES: Point[] = [[-10, 0, 0], [0, 0, 0], [4, 8, 0], [-6, 8, 3], [6, 1, 0], [-8, -6, 0]];
const seen = (lens = LENS, places = PLACES): Pair[] => places.map((place_m) => ({ picture_px: p.pixelOf(lens, place_m) ?? [NaN, NaN], place_m }));

test("pairs fit the camera that shows them, and miss as far as they are moved", () => {
  const exact = p.fit(LENS, seen());
  expect(exact.rms_px).toBeCloseTo(0, 9);
  expect(exact.rms_m).toBeCloseTo(0, 9);
  const moved = seen().map((pair, i): Pair => (i === 2 ? { ...pair, picture_px: [pair.picture_px[0] - 3, pair.picture_px[1] + 4] } : pair));
  const { misses, worst, rms_px } = p.fit(LENS, moved);
  expect(misses[2]?.offset_px[0]).toBeCloseTo(3, 9);
  expect(misses[2]?.offset_px[1]).toBeCloseTo(-4, 9);
  expect(worst).toBe(2);
  expect(rms_px).toBeCloseTo(5 / Math.sqrt(6), 9);
  // Five pixels at some 26 m.
  expect(misses[2]?.distance_m).toBeCloseTo((5 / 532) * 27.6, 0);
});

test("a place behind the camera is not shown, and no number says how well it fits", () => {
  const behind: Pair = { picture_px: [1, 1], place_m: [-30, -30, 6] };
  const { misses, rms_px, worst } = p.fit(LENS, [...seen(), behind]);
  expect(misses[6]).toBeNull();
  expect(rms_px).toBeNull();
  expect(worst).toBe(6);
  expect(p.fit(LENS, []).rms_px).toBeNull();
});

test("what is to be found needs so many pairs", () => {
  const needs = [[false, false], [true, false], [false, true], [true, true]].map(([findsFocal = false, findsK1 = false]) => p.least({ findsFocal, findsK1 }));
  expect(needs).toEqual([4, 6, 6, 7]);
});

test("poor pairs are told", () => {
  const on = (places: Point[]) => p.poverty(seen(LENS, places), [640, 360]);
  expect(on(PLACES)).toBeNull();
  expect(on([[-10, 0, 0], [-5, 0.1, 0], [0, 0, 0], [5, 0, 0]])).toBe("line");
  expect(on([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0.5, 0.6, 0]])).toBe("narrow");
  expect(on([[0, 0, 0], [1, 1, 0]])).toBeNull();
});

test("a bent lens is made straight for the solver, and back", () => {
  const bent = lensOf({ ...CAMERA, center_px: [310, 170], distortion: { model: "brown_conrady", coefficients: [-0.2, 0.05, 0.001, 0, 0] } });
  const straight = p.asPinhole(bent, 532, seen(bent)) ?? [];
  expect(p.fit(LENS, straight).rms_px).toBeCloseTo(0, 6);
});

test("where a camera of known direction stands", () => {
  const elsewhere = lensOf({ ...CAMERA, position_m: [3, 3, 3] });
  const check = (place: Point | null) => EYE.forEach((value, i) => expect(place?.[i]).toBeCloseTo(value, 6));
  check(p.standing(elsewhere, seen().slice(0, 1), 6.4));
  check(p.standing(elsewhere, seen(), null));
  check(p.standing(elsewhere, seen().slice(1, 3), null));
  expect(p.standing(elsewhere, seen().slice(0, 1), null)).toBeNull();
  expect(p.standing(elsewhere, seen().slice(0, 1), -5)).toBeNull();
  expect(p.standing(elsewhere, [], 5)).toBeNull();
});

test("pairs follow the picture's size", () => {
  expect(p.scaled([{ picture_px: [320, 90], place_m: [0, 0, 0] }], [640, 360], [1280, 720])[0]?.picture_px).toEqual([640, 180]);
});
