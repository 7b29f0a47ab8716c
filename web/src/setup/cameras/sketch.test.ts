// What is drawn into a picture lies where the camera shows it.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { lensOf } from "../../spatial/lens";
import { grid, gridStep, horizon, outline } from "./sketch";
import { direction, first } from "./torch";

const SCENE: SceneDocument = { version: 1, ground: [{ polygon: [[-20, -15], [20, -15], [20, 15], [-20, 15]] }], boxes: [{ id: "b", center_m: [0, 0, 1], size_m: [2, 2, 2] }] };
const CAMERA = first(SCENE, [640, 360]);
const numbers = (path: string) => [...path.matchAll(/(-?[\d.]+) (-?[\d.]+)/g)].map(([, x, y]) => [Number(x), Number(y)] as const);

test("the horizon is level, and as high as the camera is tilted", () => {
  const level = { ...CAMERA, world_from_camera: [...direction({ heading_deg: 77, tilt_deg: 0, roll_deg: 0 })] };
  const seen = numbers(horizon(lensOf(level)));
  expect(seen.length).toBeGreaterThan(20);
  for (const [, y] of seen) expect(y).toBeCloseTo(180, 1);
  const down = { ...CAMERA, world_from_camera: [...direction({ heading_deg: 77, tilt_deg: 10, roll_deg: 0 })] };
  const ends = numbers(horizon(lensOf(down))).map(([, y]) => y);
  for (const y of ends) expect(y).toBeCloseTo(180 - (CAMERA.focal_px[0] ?? 0) * Math.tan(Math.PI / 18), 1);
});

test("there is no horizon where the camera looks at its feet", () => {
  expect(horizon(lensOf({ ...CAMERA, world_from_camera: [...direction({ heading_deg: 0, tilt_deg: 80, roll_deg: 0 })] }))).toBe("");
});

test("a grid lies on the ground, below the horizon, and boxes stand in it", () => {
  expect(gridStep(SCENE)).toBe(1);
  const { thin, thick } = grid(lensOf(CAMERA), SCENE);
  const top = Math.max(...numbers(horizon(lensOf(CAMERA))).map(([, y]) => y));
  for (const [, y] of [...numbers(thin), ...numbers(thick)]) expect(y).toBeGreaterThan(top - 1);
  expect(numbers(thick).some(([x, y]) => Math.hypot(x - 320, y - 180) < 60)).toBe(true);
  expect(numbers(outline(lensOf(CAMERA), SCENE)).length).toBeGreaterThan(40);
});
