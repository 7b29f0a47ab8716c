// Lines leave two ways open: pairs, or the scene's middle, tell which it is.

import { expect, test } from "vitest";
import type { Point } from "../../operate/orbit";
import { lensOf } from "../../spatial/lens";
import type { AxisLine, Pair } from "../draft";
import * as b from "./building";
import { pixelOf } from "./pairs";
import { aboutVertical, between, first, inverse, point, product, quaternion } from "./torch";

const line = (axis: AxisLine["axis"]): AxisLine => ({ axis, ends_px: [[0, 0], [9, 9]] });

test("what is missing is told, the nearest to done first", () => {
  expect(b.missing([])).toEqual([{ axis: "x", n: 2 }, { axis: "y", n: 2 }]);
  expect(b.missing([line("z"), line("y")])).toEqual([{ axis: "y", n: 1 }, { axis: "z", n: 1 }]);
  expect(b.missing([line("z"), line("z"), line("x")])).toEqual([{ axis: "x", n: 1 }]);
  expect(b.missing([line("z"), line("z"), line("x"), line("x")])).toEqual([]);
});

test("an axis of one line takes no part", () => {
  expect(b.telling([line("z"), line("x"), line("z")]).map(({ axis }) => axis)).toEqual(["z", "z"]);
});

test("pairs say which way round, and where; a height does with one", () => {
  const truth = first({ version: 1 }, [640, 360]);
  const lens = lensOf(truth);
  const pairs = ([[0, 0, 0], [3, 2, 0], [-4, 3, 1]] as Point[]).map((place_m): Pair => ({ place_m, picture_px: pixelOf(lens, place_m) ?? [0, 0] }));
  // Found the other way round, along a building that stands turned by 30 degrees.
  const found = product(inverse(aboutVertical(30)), b.otherWay(quaternion(truth.world_from_camera)));
  const turned = { focal_px: truth.focal_px[0] ?? 0, world_from_camera: [...found] as [number, number, number, number], rms_px: 0, misses: [] };
  const check = (of: Pair[], height: number | null, isPlaced: boolean) => {
    const got = b.placed(turned, [640, 360], 30, of, height, point(truth.position_m), [0, 0, 0], false);
    expect(got.isPlaced).toBe(isPlaced);
    expect(between(quaternion(got.calibration.world_from_camera), quaternion(truth.world_from_camera))).toBeLessThan(1e-4);
    truth.position_m.forEach((value, i) => expect(got.calibration.position_m[i]).toBeCloseTo(value, 5));
  };
  check(pairs, null, true);
  check(pairs.slice(0, 1), 5, true);
  check([], null, false);
  const other = b.placed(turned, [640, 360], 30, [], null, point(truth.position_m), [0, 0, 0], true);
  expect(between(quaternion(other.calibration.world_from_camera), quaternion(truth.world_from_camera))).toBeGreaterThan(90);
});
