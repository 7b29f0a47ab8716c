// Trails are as long as they should be, hand-overs are noted, and nobody vanishes unsaid.

import { expect, test } from "vitest";
import { FORGET_MILLIS, type People, type Person, type Sighting, advance, nearest } from "./people";

const one = (x: number, cameras: string[]): Sighting => ({ id: "7", position: [x, 0, 0], height: 1.7, cameras });
/** West sees the west better, east the east. */
const rank = (camera: string, [x]: readonly number[]) => (camera === "west" ? 10 - (x ?? 0) : 10 + (x ?? 0));

function after(steps: readonly (readonly [at: number, told: Sighting[]])[], kept: string | null = null): People {
  return steps.reduce<People>((people, [at, told]) => advance(people, at, told, rank, kept), new Map<string, Person>());
}

test("a trail holds the last ten seconds", () => {
  const person = after(Array.from({ length: 30 }, (_, i) => [i * 500, [one(i, ["west"])]] as const)).get("7");
  expect(person?.trail).toHaveLength(21);
  expect(person?.trail[20]?.position[0]).toBe(29);
});

test("another camera takes over where it is clearly better or the only one", () => {
  const person = after([
    [0, [one(-3, ["west"])]],
    [500, [one(0, ["west", "east"])]],
    [1_000, [one(1, ["west", "east"])]],
    [1_500, [one(3, ["west", "east"])]],
    [2_000, [one(4, ["east"])]],
    [2_500, [one(4, ["west"])]],
  ]).get("7");
  expect(person?.handOvers).toEqual([{ at: 1_500, from: "west", to: "east" }, { at: 2_500, from: "east", to: "west" }]);
  expect(person?.everSeenBy).toEqual(["west", "east"]);
});

test("who is lost is said to be, then forgotten, unless somebody follows them", () => {
  const lost = after([[0, [one(0, ["west"])]], [1_000, []]]).get("7");
  expect(lost).toMatchObject({ isLost: true, seenAt: 0, cameras: [] });
  const steps: [number, Sighting[]][] = [[0, [one(0, ["west"])]], [1_000, []], [FORGET_MILLIS + 1, []]];
  expect(after(steps).has("7")).toBe(false);
  expect(after(steps, "7").get("7")?.isLost).toBe(true);
  expect(after([[0, [one(0, ["west"])]], [1_000, []], [1_500, [one(1, ["west"])]]]).get("7")?.isLost).toBe(false);
});

test("time that jumps begins anew", () => {
  const person = after([[100_000, [one(0, ["west"])]], [20_000, [one(1, ["east"])]]]).get("7");
  expect(person?.trail).toHaveLength(1);
  expect(person?.handOvers).toEqual([]);
});

test("the nearest is found within reach, and lost ones are not", () => {
  const people = after([[0, [one(0, ["west"]), { ...one(5, ["west"]), id: "8" }]]]);
  expect(nearest(people.values(), [4, 0, 0], 2)?.id).toBe("8");
  expect(nearest(people.values(), [4, 9, 0], 2)).toBeNull();
});
