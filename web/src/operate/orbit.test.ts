// Turning, moving and coming nearer keep what they should keep, and views survive the address.

import { expect, test } from "vitest";
import { moved, nearer, placed, printed, read, readField, turned, type View } from "./orbit";

const view: View = { eye: [0, -10, 5], target: [0, 0, 0], fov: 50 };
const distance = ({ eye, target }: View) => Math.hypot(eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]);

test("turning keeps the distance and never goes over the top", () => {
  const once = turned(view, 0.3, 0);
  expect(distance(once)).toBeCloseTo(distance(view), 9);
  expect(once.eye[2]).toBeCloseTo(5, 9);
  const above = turned(view, 0, 10);
  expect(above.eye[1]).toBeLessThan(0);
  expect(above.eye[2]).toBeLessThan(distance(view));
});

test("coming nearer keeps the direction, and stops before the target", () => {
  expect(distance(nearer(view, 0.5))).toBeCloseTo(distance(view) / 2, 9);
  expect(distance(nearer(view, 0))).toBeCloseTo(0.05, 9);
});

test("moving keeps the height and takes the target along", () => {
  const next = moved(view, 0.1, 0);
  expect(next.eye[2]).toBe(5);
  expect(next.eye[0]).toBeGreaterThan(0);
  expect(next.eye[0]).toBeCloseTo(next.target[0], 9);
});

test("the target stands in the middle, and what lies behind nowhere", () => {
  expect(placed(view, 16 / 9, [0, 0, 0])?.map((share) => share.toFixed(6))).toEqual(["0.500000", "0.500000"]);
  expect(placed(view, 16 / 9, [0, -30, 5])).toBeNull();
  const [x = 0, y = 0] = placed(view, 16 / 9, [1, 0, 0]) ?? [];
  expect(x).toBeGreaterThan(0.5);
  expect(y).toBeCloseTo(0.5, 9);
});

test("a view survives the address and comes from the daemon's field", () => {
  expect(read(printed(view))).toEqual(view);
  expect(readField("eye=0,-10,5;target=0,0,0;fov=50")).toEqual(view);
  for (const text of [null, "", "eye=0,0;target=0,0,0;fov=50", "eye=1,1,1;target=1,1,1;fov=50", "eye=a,b,c;target=0,0,0;fov=50"]) {
    expect(readField(text)).toBeNull();
  }
});
