import { describe, expect, test } from "vitest";
import { readFileSync } from "node:fs";
import type { Point } from "../operate/orbit";
import { brownConradyFold, fisheyeFold, isWithin, rootFreeReach } from "./fold";
import { type Calibration, footprint, fovDeg, isInside, lensOf, project, ray } from "./lens";
import { lensUniform } from "./lensShader";

type Plaza = { cameras: { id: string; calibration: Calibration }[] };
const plaza = JSON.parse(readFileSync("../config/demo/plaza.json", "utf8")) as Plaza;
const calibrations = new Map(plaza.cameras.map(({ id, calibration }) => [id, calibration]));
const of = (id: string) => calibrations.get(id) as Calibration;
const with_ = (distortion: NonNullable<Calibration["distortion"]>) => lensOf({ ...of("west"), distortion });

const LENSES = {
  pinhole: lensOf(of("west")),
  barrel: lensOf(of("north")),
  tangential: with_({ model: "brown_conrady", coefficients: [-0.2, 0.05, 0.004, -0.003, 0.01] }),
  rational: with_({ model: "brown_conrady", coefficients: [0.3, 0.1, 0.001, 0.002, 0.02, 0.5, 0.15, 0.03] }),
  fisheye: with_({ model: "fisheye", coefficients: [-0.02, 0.003, -0.001, 0.0001] }),
};

describe("a lens", () => {
  test.each(Object.entries(LENSES))("shows on a texel what lies on its ray (%s)", (_, lens) => {
    for (let i = 0; i <= 10; i += 1) {
      for (let j = 0; j <= 10; j += 1) {
        const through = ray(lens, [i / 10, j / 10]);
        expect(through).not.toBeNull();
        if (!through) continue;
        expect(Math.hypot(...through.direction)).toBeCloseTo(1, 12);
        for (const reach of [0.5, 20, 3_000]) {
          const point = through.origin.map((at, axis) => at + reach * (through.direction[axis] ?? 0)) as unknown as Point;
          const back = project(lens, point);
          expect(back?.u).toBeCloseTo(i / 10, 8);
          expect(back?.v).toBeCloseTo(j / 10, 8);
        }
      }
    }
  });

  test("stands where the calibration says, x to the right and y down", () => {
    const lens = lensOf(of("west"));
    const [right, down, forward] = lens.axes;
    expect(lens.position).toEqual([-15.5, -11.5, 6.4]);
    // Level, looking to the north-east and downwards.
    expect(right[2]).toBeCloseTo(0, 9);
    expect(down[2]).toBeLessThan(-0.5);
    expect(forward[0]).toBeGreaterThan(0);
    expect(forward[1]).toBeGreaterThan(0);
    expect(forward[2]).toBeLessThan(0);
    const ahead = lens.position.map((at, axis) => at + 5 * (forward[axis] ?? 0)) as unknown as Point;
    expect(project(lens, ahead)?.u).toBeCloseTo(0.5, 12);
    expect(project(lens, ahead)?.v).toBeCloseTo(0.5, 12);
    const behind = lens.position.map((at, axis) => at - 5 * (forward[axis] ?? 0)) as unknown as Point;
    expect(project(lens, behind)).toBeNull();
    expect(fovDeg(lens)).toBeCloseTo((2 * Math.atan(180 / 532.5694343521658) * 180) / Math.PI, 6);
  });

  test("shows a corner of the hall where OpenCV's formula puts it", () => {
    // By hand: the pinhole's place, times 1 - 0.1 r^2.
    const lens = lensOf(of("north"));
    const point: Point = [-1, 6.5, 0];
    const [right, down, forward] = lens.axes;
    const offset = point.map((at, axis) => at - (lens.position[axis] ?? 0));
    const along = (axis: Point) => axis.reduce((sum, part, i) => sum + part * (offset[i] ?? 0), 0);
    const [x, y] = [along(right) / along(forward), along(down) / along(forward)];
    const q = 1 - 0.1 * (x * x + y * y);
    const shown = project(lens, point);
    expect(shown?.u).toBeCloseTo((424.6543429185312 * x * q + 320) / 640, 12);
    expect(shown?.v).toBeCloseTo((424.6543429185312 * y * q + 180) / 360, 12);
    expect(shown && isInside(shown)).toBe(true);
  });

  test("has no texel for what lies beyond its fold", () => {
    const lens = with_({ model: "brown_conrady", coefficients: [-0.3] });
    const at = (tangent: number): Point =>
      lens.position.map((from, axis) => from + (lens.axes[2][axis] ?? 0) + tangent * (lens.axes[0][axis] ?? 0)) as unknown as Point;
    expect(project(lens, at(1.05))).not.toBeNull();
    expect(project(lens, at(1.06))).toBeNull();
  });

  test("shows a piece of the ground, as far as is asked for", () => {
    const outline = footprint(lensOf(of("west")), 0, 60);
    expect(outline.length).toBe(32);
    for (const [x, y, z] of outline) {
      expect(z).toBe(0);
      expect(Math.hypot(x + 15.5, y + 11.5)).toBeLessThanOrEqual(60 + 1e-9);
    }
    expect(footprint(lensOf(of("west")), 20)).toEqual([]);
  });

  test("is for shaders what it is here", () => {
    const vectors = lensUniform(lensOf(of("north")), [1, 2, 3]);
    expect(vectors).toHaveLength(8);
    expect(vectors[3]?.toArray().slice(0, 3)).toEqual([4.6 - 1, 13.6 - 2, 7.2 - 3]);
    expect(vectors[3]?.w).toBe(1);
    expect(vectors[7]?.x).toBeCloseTo(1 / Math.sqrt(0.3), 9);
  });
});

describe("a fold", () => {
  test("is the first root, and never beyond", () => {
    const near = (polynomial: number[], root: number) => {
      const reach = rootFreeReach(polynomial, 1e6) ?? NaN;
      expect(reach).toBeLessThanOrEqual(root);
      expect(reach).toBeGreaterThan(root * (1 - 1e-9));
    };
    near([1, -1], 1);
    near([1, 0, -0.25], 2);
    expect(rootFreeReach([1, 3, 0, 2], 10)).toBe(Infinity);
    expect(rootFreeReach([1, NaN], 10)).toBeNull();
  });

  test("lies where the book says", () => {
    expect(brownConradyFold([-0.3, 0, 0, 0, 0, 0, 0, 0])?.maxRadius).toBeCloseTo(1 / Math.sqrt(0.9), 9);
    expect(brownConradyFold([0, 0, 0, 0, 0, -1, 0, 0])?.maxRadius).toBeCloseTo(1, 9);
    expect(fisheyeFold([-0.1, 0, 0, 0])?.maxTheta).toBeCloseTo(Math.sqrt(1 / 0.3), 9);
    expect(fisheyeFold([0, 0, 0, 0])?.maxTheta).toBe(Math.PI);
    expect(brownConradyFold([-1e9, 0, 0, 0, 0, 0, 0, 0])).toBeNull();
    const fold = brownConradyFold([0, 0, 0, 0.05, 0, 0, 0, 0]);
    expect(fold && isWithin(fold, 5, 0)).toBe(true);
    expect(fold && isWithin(fold, -3.34, 0)).toBe(false);
  });
});
