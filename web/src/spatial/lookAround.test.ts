import { expect, test } from "vitest";
import { facing, lookedAlong } from "./lookAround";

const near = (a: readonly number[], b: readonly number[]) => b.forEach((part, i) => expect(a[i]).toBeCloseTo(part, 9));

test("a device's back looks down from a table, and ahead when it is held upright", () => {
  near(facing(0, 0, 0), [0, 0, -1]);
  near(facing(0, 90, 0), [0, 1, 0]);
  // Turned to the left by a quarter: west.
  near(facing(90, 90, 0), [-1, 0, 0]);
  // On its side, upright.
  near(facing(0, 0, -90), [1, 0, 0]);
});

test("a view follows it, from where it began", () => {
  const view = { eye: [1, 2, 3], target: [1, 12, 3], fov: 45 } as const;
  near(lookedAlong(view, [0, 1, 0], 0).target, [1, 12, 3]);
  near(lookedAlong(view, [0, 1, 0], Math.PI / 2).target, [-9, 2, 3]);
  expect(lookedAlong(view, [0, 0, 1], 0).target[2]).toBeLessThan(13);
});
