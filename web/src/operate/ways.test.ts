// Who walks stays at a person's height whatever they look at; who flies goes where they look; turning the head moves nobody.

import { expect, test } from "vitest";
import { type View, axes, toward, placed, between } from "./orbit";
import { EYE_HEIGHT_M, gone, looked, standing, stoodAt, taken } from "./ways";

const view: View = { eye: [0, -10, 5], target: [0, 0, 0], fov: 50 };
const still = { right: 0, ahead: 0, up: 0, isFast: false };

test("turning the head keeps the place, and never looks over the top", () => {
  const left = looked(view, Math.PI / 2, 0);
  expect(left.eye).toEqual(view.eye);
  expect(axes(left).forward[0]).toBeLessThan(-0.5);
  const up = looked(view, 0, 10);
  expect(axes(up).forward[2]).toBeGreaterThan(0.99);
  expect(axes(up).forward[1]).toBeGreaterThan(0);
});

test("who walks stays level, who flies goes where they look", () => {
  const down = standing(view, 0);
  expect(down.eye[2]).toBeCloseTo(EYE_HEIGHT_M, 9);
  const walked = gone(down, "walk", { ...still, ahead: 1 }, 2, 0);
  expect(walked.eye[2]).toBeCloseTo(EYE_HEIGHT_M, 9);
  expect(walked.eye[1]).toBeCloseTo(-6, 9);
  const flown = gone(view, "fly", { ...still, ahead: 1 }, 1, 0);
  expect(flown.eye[2]).toBeLessThan(5);
  expect(gone(view, "fly", { ...still, up: 1 }, 1, 0).eye[2]).toBeGreaterThan(5);
  expect(gone(view, "fly", { ...still, right: 1 }, 1, 0).eye[0]).toBeGreaterThan(0);
});

test("taking to walking comes down to what one stands on and looks ahead", () => {
  const down = taken(view, "walk", () => 3);
  expect(down.eye).toEqual([0, -10, 3 + EYE_HEIGHT_M]);
  expect(axes(down).forward.map((part) => Math.round(part * 1e6) + 0)).toEqual([0, 1e6, 0]);
  expect(stoodAt(view, [4, 4, 1]).eye).toEqual([4, 4, 1 + EYE_HEIGHT_M]);
  expect(taken(view, "orbit", () => 3)).toBe(view);
});

test("the direction of a place of the picture leads to what is shown there", () => {
  for (const place of [[0.5, 0.5], [0.2, 0.9], [0.83, 0.31]] as const) {
    const [x, y, z] = toward(view, 16 / 9, place);
    const found = placed(view, 16 / 9, [view.eye[0] + 7 * x, view.eye[1] + 7 * y, view.eye[2] + 7 * z]);
    expect(found?.[0]).toBeCloseTo(place[0], 9);
    expect(found?.[1]).toBeCloseTo(place[1], 9);
  }
});

test("half way lies half way", () => {
  const there = { eye: [2, -10, 5], target: [2, 0, 0], fov: 30 } as const;
  expect(between(view, there, 0.5)).toEqual({ eye: [1, -10, 5], target: [1, 0, 0], fov: 40 });
  expect(between(view, there, 1)).toEqual(there);
});
