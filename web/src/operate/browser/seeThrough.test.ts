import { expect, test } from "vitest";
import type { Point } from "../orbit";
import { type Crossed, Openings, type Standing, hidingOf } from "./seeThrough";

/** A wall along y = 0, from x = -8 to 8, so high. */
const wall = (high: number): Crossed => ({ origin, direction }) => {
  const reach = -origin[1] / direction[1];
  const [x, z] = [origin[0] + direction[0] * reach, origin[2] + direction[2] * reach];
  return reach > 0 && Math.abs(x) < 8 && z > 0 && z < high ? ["/boxes/0"] : [];
};
const person = (place: Point): Standing => ({ place, upright: { foot: place, right: [1, 0, 0], halfWidth: 0.3, height: 1.8, isCut: false } });
const EYE: Point = [0, -20, 1.7];

test("who is behind a wall is hidden by it, who is before it or beside it is not", () => {
  const hiding = hidingOf([person([0, 5, 0]), person([0, -5, 0]), person([30, 5, 0])], EYE, wall(4));
  expect([...hiding.keys()]).toEqual(["/boxes/0"]);
  expect(hiding.get("/boxes/0")).toEqual({ share: 1, hides: new Set([0]) });
  expect(hidingOf([person([0, 5, 0])], EYE, wall(4), new Set(["/boxes/0"])).size).toBe(0);
  // A kerb hides feet alone.
  expect(hidingOf([person([0, 1, 0])], EYE, wall(0.3)).get("/boxes/0")?.share).toBeLessThan(0.25);
});

test("a viewer at somebody's own place hides and breaks nothing", () => {
  expect(hidingOf([person([0, 5, 0])], [0, 5, 0.99], wall(4)).size).toBe(0);
});

test("what hides most of somebody opens smoothly, stays open at the edge and closes again", () => {
  const openings = new Openings();
  const hidden = (share: number) => new Map([["a", { share, hides: new Set([0]) }]]);
  expect(openings.step(hidden(0.4), 0)).toBe(false);
  expect(openings.opacities.size).toBe(0);
  expect(openings.step(hidden(0.6), 16)).toBe(true);
  const first = openings.opacities.get("a") ?? 0;
  expect(first).toBeGreaterThan(0.3);
  expect(first).toBeLessThan(1);
  expect(openings.step(hidden(0.3), 3_000)).toBe(false);
  expect(openings.opacities.get("a")).toBe(0.3);
  openings.step(new Map(), 3_016);
  expect(openings.opacities.get("a")).toBeGreaterThan(0.3);
  expect(openings.step(new Map(), 9_000)).toBe(false);
  expect(openings.opacities.size).toBe(0);
});

test("the first picture shows what is open at once", () => {
  const openings = new Openings();
  openings.step(new Map([["a", { share: 1, hides: new Set([0]) }]]), 5);
  expect(openings.opacities.get("a")).toBe(0.3);
});
