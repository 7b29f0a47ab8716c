// What is drawn and dragged comes to lie on corners, edges, right angles and the grid, in this order.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { NOTHING_NEAR, snapHeight, snapMove, snapPoint, snapTurn, targetsOf, turnsOf } from "./snapping";

const DOCUMENT: SceneDocument = {
  version: 1,
  boxes: [{ id: "hall", center_m: [10, 10, 1], size_m: [4, 2, 2] }],
  cylinders: [{ id: "tank", base_m: [0, 0, 0], radius_m: 1, height_m: 2 }],
  footprints: [{ id: "slant", polygon: [[20, 0], [23, 4], [19, 7]], top_m: 3 }],
};
const near = { targets: targetsOf(DOCUMENT, new Set()), reach: 0.3, grid: 0.5 };
const shown = (at: readonly number[]) => at.map((metres) => Number(metres.toFixed(4)));

test("corners come first, then edges, then the grid", () => {
  expect(snapPoint([8.1, 9.2], near)).toEqual({ at: [8, 9], guides: [{ kind: "corner", line: [[8, 9], [8, 9]] }] });
  const onEdge = snapPoint([9.4, 9.2], near);
  expect(shown(onEdge.at)).toEqual([9.5, 9]);
  expect(onEdge.guides[0]?.kind).toBe("edge");
  expect(shown(snapPoint([5.1, 5.3], near).at)).toEqual([5, 5.5]);
  expect(snapPoint([5.1, 5.3], NOTHING_NEAR).at).toEqual([5.1, 5.3]);
});

test("places are level with corners, and come where two lines cross", () => {
  const level = snapPoint([5.1, 9.2], near);
  expect(shown(level.at)).toEqual([5, 9]);
  expect(level.guides[0]?.kind).toBe("line");
  const both = snapPoint([1.1, 8.9], near);
  expect(shown(both.at)).toEqual([1, 9]);
  expect(both.guides).toHaveLength(2);
});

test("what is drawn on from a corner is square to the edge before, and as long as the grid has it", () => {
  const plain = { ...near, targets: NOTHING_NEAR.targets };
  const square = snapPoint([-0.93, 1.15], plain, { last: [3, 4], before: [0, 8] });
  expect(shown(square.at)).toEqual([-1, 1]);
  expect(shown(snapPoint([7.1, 4.2], plain, { last: [3, 4] }).at)).toEqual([7, 4]);
});

test("what is moved meets others", () => {
  const outline = [[0, 0], [1, 0], [1, 1], [0, 1]] as const;
  expect(shown(snapMove(outline, [6.9, 8.1], near).by)).toEqual([7, 8]);
  const touch = snapMove(outline, [6.8, 9.45], near);
  expect(shown(touch.by)).toEqual([7, 9.45]);
  expect(touch.guides[0]?.kind).toBe("edge");
  const level = snapMove(outline, [4.1, 8.2], { ...near, targets: { ...near.targets, edges: [] } });
  expect(shown(level.by)).toEqual([4.1, 8]);
  expect(shown(snapMove(outline, [-9.8, -9.3], near).by)).toEqual([-10, -9.5]);
});

test("turns are square to others or go in steps", () => {
  const turns = turnsOf(DOCUMENT, new Set(["hall"]));
  expect(snapTurn(52, turns)).toBeCloseTo(53.1301);
  expect(snapTurn(-38, turns)).toBeCloseTo(-36.8699);
  expect(snapTurn(22, [])).toBe(15);
  expect(turnsOf(DOCUMENT, new Set(["slant"]))).toEqual([0]);
});

test("heights are level with others", () => {
  expect(snapHeight(2.9, [3, 6], { reach: 0.2, grid: 1 })).toBe(3);
  expect(snapHeight(4.4, [3, 6], { reach: 0.2, grid: 0.5 })).toBe(4.5);
  expect(snapHeight(4.44, [], { reach: 0.2, grid: 0 })).toBe(4.44);
});
