// Poses from angles and aims keep the camera's conventions: x right, y down, z forward, clockwise headings.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import type { Point } from "../../operate/orbit";
import * as t from "./torch";

const near = (a: readonly number[], b: readonly number[], digits = 9) => a.forEach((value, i) => expect(value).toBeCloseTo(b[i] ?? NaN, digits));
const IDENTITY: t.Quaternion = [0, 0, 0, 1];

test("a level camera northwards has east at its right and the ground beneath", () => {
  const q = t.direction({ heading_deg: 0, tilt_deg: 0, roll_deg: 0 });
  near(t.turned(q, [1, 0, 0]), [1, 0, 0]);
  near(t.turned(q, [0, 1, 0]), [0, 0, -1]);
  near(t.turned(q, [0, 0, 1]), [0, 1, 0]);
});

test("heading goes clockwise, tilt goes down, roll turns the right side down", () => {
  near(t.turned(t.direction({ heading_deg: 90, tilt_deg: 30, roll_deg: 0 }), [0, 0, 1]), [Math.cos(Math.PI / 6), 0, -0.5]);
  near(t.turned(t.direction({ heading_deg: 0, tilt_deg: 0, roll_deg: 10 }), [1, 0, 0]), [Math.cos(Math.PI / 18), 0, -Math.sin(Math.PI / 18)]);
});

test("angles come back from the direction that they gave, everywhere", () => {
  for (let heading_deg = 0; heading_deg < 360; heading_deg += 30) {
    for (let tilt_deg = -80; tilt_deg <= 80; tilt_deg += 40) {
      for (let roll_deg = -170; roll_deg < 180; roll_deg += 50) {
        const back = t.angles(t.direction({ heading_deg, tilt_deg, roll_deg }));
        near([Math.cos(((back.heading_deg - heading_deg) * Math.PI) / 180), back.tilt_deg, back.roll_deg], [1, tilt_deg, roll_deg], 6);
      }
    }
  }
});

test("looking at a place puts it on the axis, also straight down", () => {
  const check = (position: Point, aim: Point, roll: number) => {
    const q = t.lookingAt(position, aim, roll, IDENTITY);
    near(t.turned(t.inverse(q), t.unit(t.minus(aim, position))), [0, 0, 1]);
    expect(Math.hypot(...q)).toBeCloseTo(1, 9);
  };
  check([1, 2, 5], [8, -3, 0], 0);
  check([1, 2, 5], [8, -3, 0], 25);
  check([1, 2, 5], [1, 2, 0], 0);
  check([1, 2, 5], [1, 2, 9], 40);
  expect(t.lookingAt([1, 2, 3], [1, 2, 3], 0, [1, 0, 0, 0])).toEqual([1, 0, 0, 0]);
});

test("a known camera has the axes that the daemon tells of it", () => {
  const q: t.Quaternion = [0, -0.923879533, 0.382683432, 0];
  near(t.turned(q, [1, 0, 0]), [-1, 0, 0], 6);
  near(t.turned(q, [0, 0, 1]), [0, -0.707106781, -0.707106781], 6);
  const { heading_deg, tilt_deg, roll_deg } = t.angles(q);
  near([heading_deg, tilt_deg, roll_deg], [180, 45, 0], 5);
  expect(t.between(q, t.direction({ heading_deg: 180, tilt_deg: 43, roll_deg: 0 }))).toBeCloseTo(2, 5);
  near(t.aim({ position_m: [0, 8, 6], world_from_camera: [...q] }, 0), [0, 2, 0], 5);
});

test("the first pose stands at the ground's edge and sees its middle", () => {
  const document: SceneDocument = { version: 1, ground: [{ polygon: [[-10, -20], [30, -20], [30, 20], [-10, 20]], height_m: 2 }] };
  const south = t.first(document, [640, 360]);
  expect(south.position_m).toEqual([10, -20, 7]);
  near(t.aim(south, 2), [10, 0, 2]);
  expect(t.fov(south.focal_px[0] ?? 0, 640)).toBeCloseTo(60, 9);
  expect(t.first(document, [640, 360], 1).position_m).toEqual([30, 0, 7]);
  expect(t.first({ version: 1 }, [4, 3]).position_m).toEqual([0, -10, 5]);
});

test("turns after one another", () => {
  near(t.turned(t.product(t.aboutVertical(90), t.aboutVertical(-30)), [1, 0, 0]), [0.5, Math.sqrt(3) / 2, 0]);
});
