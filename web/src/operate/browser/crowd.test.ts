import { expect, test } from "vitest";
import type { Point } from "../orbit";
import { type Known, type Seen, chosen, memory } from "./crowd";

const EYES: Record<string, Point> = { west: [-15, 0, 5], east: [15, 0, 5], south: [0, -15, 5] };
const seen = (camera: string, track: number, foot: Point, more: { isCut?: boolean; millis?: number } = {}): Seen => ({
  camera, track, millis: more.millis ?? 1_000, eye: EYES[camera] ?? [0, 0, 0],
  upright: { foot, right: [1, 0, 0], halfWidth: 0.3, height: 1.7, isCut: more.isCut ?? false },
});
const known = (id: string, position: Point, cameras: string[]): Known => ({ id, position, cameras, isLost: false });

test("somebody whom two cameras see is drawn once, by the one that looks the viewer's way", () => {
  const all = [seen("west", 4, [0.2, 0, 0]), seen("east", 9, [-0.1, 0, 0])];
  const people = [known("1", [0, 0, 0], ["west", "east"])];
  expect(chosen(all, people, 1_000, [-10, 1, 3], memory()).map(({ seen: { camera } }) => camera)).toEqual(["west"]);
  expect(chosen(all, people, 1_000, [10, 1, 3], memory()).map(({ seen: { camera } }) => camera)).toEqual(["east"]);
});

test("they stand where the daemon says, and move with their camera's foot in between", () => {
  const remembered = memory();
  const people = [known("1", [0, 0, 0], ["west"])];
  const [first] = chosen([seen("west", 4, [0.4, 0, 0])], people, 1_000, [-10, 0, 3], remembered);
  expect(first?.place[0]).toBeCloseTo(0);
  const [next] = chosen([seen("west", 4, [0.5, 0, 0], { millis: 1_100 })], people, 1_000, [-10, 0, 3], remembered);
  expect(next?.place[0]).toBeCloseTo(0.1);
});

test("two people near one another stay two", () => {
  const all = [seen("west", 1, [0, 0, 0]), seen("west", 2, [0.5, 0, 0]), seen("east", 7, [0.05, 0, 0]), seen("east", 8, [0.55, 0, 0])];
  const people = [known("a", [0, 0, 0], ["west", "east"]), known("b", [0.5, 0, 0], ["west", "east"])];
  const drawn = chosen(all, people, 1_000, [-10, 0, 3], memory());
  expect(drawn.map(({ person }) => person).sort()).toEqual(["a", "b"]);
  expect(drawn.every(({ seen: { camera } }) => camera === "west")).toBe(true);
});

test("whom the daemon does not know is drawn once where feet are together, else each", () => {
  const together = chosen([seen("west", 1, [0, 0, 0]), seen("east", 2, [0.3, 0, 0])], [], NaN, [-10, 0, 3], memory());
  expect(together).toHaveLength(1);
  expect(together[0]?.person).toBeNull();
  expect(chosen([seen("west", 1, [0, 0, 0]), seen("east", 2, [3, 0, 0])], [], NaN, [-10, 0, 3], memory())).toHaveLength(2);
});

test("what the border cuts is drawn only where nobody sees the whole", () => {
  const people = [known("1", [0, 0, 0], ["west", "east"])];
  const all = [seen("west", 4, [0, 0, 0], { isCut: true }), seen("east", 9, [0, 0, 0])];
  expect(chosen(all, people, 1_000, [-10, 0, 3], memory())[0]?.seen.camera).toBe("east");
});

test("a source is left only for a clearly better one", () => {
  const remembered = memory();
  const people = [known("1", [0, 0, 0], ["west", "south"])];
  const all = [seen("west", 4, [0, 0, 0]), seen("south", 9, [0, 0, 0])];
  expect(chosen(all, people, 1_000, [-10, -8, 3], remembered)[0]?.seen.camera).toBe("west");
  expect(chosen(all, people, 1_000, [-10, -10.5, 3], remembered)[0]?.seen.camera).toBe("west");
  expect(chosen(all, people, 1_000, [-6, -14, 3], remembered)[0]?.seen.camera).toBe("south");
});
