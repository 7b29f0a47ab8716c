import { expect, test } from "vitest";
import type { View } from "./orbit";
import type { Person } from "./people";
import { personAt } from "./picking";

const view: View = { eye: [0, -10, 1.7], target: [0, 0, 1.7], fov: 50 };
const person = (id: string, x: number, y: number, isLost = false): Person =>
  ({ id, position: [x, y, 0], height: 1.8, cameras: ["west"], seenAt: 0, trail: [], isLost, best: null, handOvers: [], everSeenBy: [] });

test("a click on somebody's figure means them, the nearer of two", () => {
  const people = [person("far", 0, 10), person("near", 0, 0), person("beside", 3, 0), person("lost", -3, 0, true)];
  expect(personAt(people, view, 1.5, [0.5, 0.55])?.id).toBe("near");
  expect(personAt(people, view, 1.5, [0.5 + 3 / (20 * Math.tan((25 * Math.PI) / 180) * 1.5), 0.6])?.id).toBe("beside");
  expect(personAt(people, view, 1.5, [0.5 - 3 / (20 * Math.tan((25 * Math.PI) / 180) * 1.5), 0.6])).toBeNull();
  expect(personAt(people, view, 1.5, [0.5, 0.1])).toBeNull();
});
