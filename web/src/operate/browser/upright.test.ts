import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { type Calibration, lensOf, meetLevel, project } from "../../spatial/lens";
import type { Point } from "../orbit";
import type { Rectangle } from "./foreground";
import { type Meet, downAt, turnedTowards, uprightOf } from "./upright";

const plaza = JSON.parse(readFileSync("../config/demo/plaza.json", "utf8")) as { cameras: { id: string; calibration: Calibration }[] };
const lensBy = (id: string) => lensOf((plaza.cameras.find((camera) => camera.id === id) as { calibration: Calibration }).calibration);
const SIZE = [640, 360] as const;
const ground: Meet = (through) => {
  const point_m = meetLevel(through, 0);
  return point_m && { point_m, normal: [0, 0, 1] };
};

/** What a camera shows of an upright board that faces it. */
function board(id: string, [x, y]: readonly [number, number], width: number, height: number): Rectangle {
  const lens = lensBy(id);
  const away = Math.hypot(x - lens.position[0], y - lens.position[1]);
  const right: Point = [(y - lens.position[1]) / away, -(x - lens.position[0]) / away, 0];
  const mask = new Uint8Array(640 * 360);
  let [left, top, last, bottom] = [640, 360, 0, 0];
  for (let across = -width / 2; across <= width / 2; across += 0.005) {
    for (let up = 0; up <= height; up += 0.005) {
      const seen = project(lens, [x + right[0] * across, y + right[1] * across, up]);
      if (!seen) continue;
      const [column, row] = [Math.floor(seen.u * 640), Math.floor(seen.v * 360)];
      mask[row * 640 + column] = 255;
      [left, top, last, bottom] = [Math.min(left, column), Math.min(top, row), Math.max(last, column), Math.max(bottom, row)];
    }
  }
  const [w, h] = [last - left + 1, bottom - top + 1];
  const own = new Uint8Array(w * h);
  for (let row = 0; row < h; row += 1) for (let column = 0; column < w; column += 1) own[row * w + column] = mask[(top + row) * 640 + left + column] ?? 0;
  return { left, top, width: w, height: h, track: 1, mask: own, jpeg: new Uint8Array() };
}

test.each([["west", [0, 0]], ["east", [3, 2]], ["north", [2, -3]]] as const)("a board stands where it stood, as large as it was (%s)", (id, place) => {
  const found = uprightOf(lensBy(id), SIZE, board(id, place, 0.6, 1.75), ground);
  expect(found).not.toBeNull();
  if (!found) return;
  expect(Math.hypot(found.foot[0] - place[0], found.foot[1] - place[1])).toBeLessThan(0.15);
  expect(Math.abs(found.height - 1.75)).toBeLessThan(0.1);
  expect(Math.abs(2 * found.halfWidth - 0.6)).toBeLessThan(0.1);
  expect(found.isCut).toBe(false);
});

test("what is seen before a wall stands at its foot", () => {
  const wall: Meet = ({ origin, direction }) => {
    if (direction[2] === -1) return { point_m: [origin[0], origin[1], 0], normal: [0, 0, 1] };
    const reach = (-2 - origin[1]) / direction[1];
    const height = origin[2] + direction[2] * reach;
    return reach > 0 && height > 0 ? { point_m: [origin[0] + direction[0] * reach, -2, height], normal: [0, -1, 0] } : ground({ origin, direction });
  };
  const found = uprightOf(lensBy("west"), SIZE, board("west", [0, 0], 0.6, 1.75), wall);
  expect(found?.foot[2]).toBe(0);
  expect(found?.foot[1]).toBeCloseTo(-2.05, 1);
});

test("down is below before a level camera", () => {
  expect(downAt(lensBy("west"), [0.5, 0.5], SIZE)).toBe("below");
  const ceiling = lensOf({
    image_size_px: [64, 48], focal_px: [40, 40], center_px: [32, 24], position_m: [0, 0, 6],
    // x east, y south, z down.
    world_from_camera: [1, 0, 0, 0],
  });
  expect(downAt(ceiling, [0.1, 0.5], [64, 48])).toBe("right");
  expect(downAt(ceiling, [0.9, 0.5], [64, 48])).toBe("left");
  expect(downAt(ceiling, [0.5, 0.1], [64, 48])).toBe("below");
  expect(downAt(ceiling, [0.5, 0.9], [64, 48])).toBe("above");
});

test("a rectangle turns only as far as it must", () => {
  const [right, up] = turnedTowards([1, 0, 0], [0, 0, 0], [2, -10, 1.5]);
  expect(right).toEqual([1, 0, 0]);
  expect(up).toEqual([0, 0, 1].map((part) => expect.closeTo(part, 9) as number));
  const [aside] = turnedTowards([1, 0, 0], [0, 0, 0], [10, 0, 0]);
  // Edge-on it turns by 30 degrees, towards the viewer.
  expect(Math.abs(aside[0])).toBeCloseTo(Math.cos(Math.PI / 6), 9);
  const [, leaning] = turnedTowards([1, 0, 0], [0, 0, 0], [0, -0.001, 50]);
  expect(leaning[2]).toBeCloseTo(Math.SQRT1_2, 2);
  expect(leaning[1]).toBeGreaterThan(0.7);
});
