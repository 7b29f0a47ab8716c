// What is dragged follows the pointer, and the opposite side stays where it is.

import { expect, test } from "vitest";
import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import { handlesOf } from "./handles";
import { extentOf, thing } from "./things";

const DOCUMENT: SceneDocument = {
  version: 1,
  boxes: [{ id: "hall", center_m: [10, 0, 2], size_m: [4, 2, 4], yaw_deg: 90 }],
  cylinders: [{ id: "tank", base_m: [5, 5, 1], radius_m: 1, height_m: 3 }],
  footprints: [{ id: "house", polygon: [[0, 0], [4, 0], [4, 2]], top_m: 3 }],
  models: [{ id: "kiosk", file: "assets/kiosk.glb", position_m: [1, 1, 0] }],
};

function dragged(ids: string[], key: string, to: Point): SceneDocument {
  const handle = handlesOf(DOCUMENT, ids, 1).find((one) => one.key === key);
  if (!handle) throw new Error(key);
  return handle.apply(DOCUMENT, to);
}

test("a handle that is dropped where it was changes nothing of note", () => {
  for (const id of ["hall", "tank", "house", "kiosk"]) {
    for (const handle of handlesOf(DOCUMENT, [id], 1)) {
      if (handle.kind === "between") continue;
      const [before, after] = [thing(DOCUMENT, id), thing(handle.apply(DOCUMENT, handle.at), id)];
      const [one, other] = [before && extentOf(before), after && extentOf(after)];
      expect(other?.high, `${id} ${handle.key}`).toBeCloseTo(one?.high ?? 0);
      expect(other?.outline[1]?.[0], `${id} ${handle.key}`).toBeCloseTo(one?.outline[1]?.[0] ?? 0);
    }
  }
});

test("a turned box is stretched along its own axes", () => {
  // Its own x is north.
  expect(dragged(["hall"], "side1,0", [10.7, 5, 4]).boxes?.[0]).toMatchObject({ center_m: [10, 1.5, 2], size_m: [7, 2, 4] });
  expect(dragged(["hall"], "corner-1,-1", [13, -4, 4]).boxes?.[0]).toMatchObject({ center_m: [11, -1, 2], size_m: [6, 4, 4] });
  expect(dragged(["hall"], "side1,0", [10, -50, 4]).boxes?.[0]?.size_m[0]).toBe(0.01);
  expect(dragged(["hall"], "top", [0, 0, 6]).boxes?.[0]).toMatchObject({ center_m: [10, 0, 3], size_m: [4, 2, 6] });
});

test("things are turned and lifted, one or several", () => {
  expect(dragged(["hall"], "turn", [20, 0, 4]).boxes?.[0]).toMatchObject({ center_m: [10, 0, 2], yaw_deg: 0 });
  expect(dragged(["hall"], "lift", [0, 0, 5.5]).boxes?.[0]?.center_m).toEqual([10, 0, 2.5]);
  expect(dragged(["hall", "tank"], "lift", [0, 0, 7]).cylinders?.[0]?.base_m).toEqual([5, 5, 3]);
});

test("radii, heights, corners and scales", () => {
  expect(dragged(["tank"], "side0,1", [5, 8, 4]).cylinders?.[0]?.radius_m).toBe(3);
  expect(dragged(["tank"], "top", [0, 0, 2]).cylinders?.[0]?.height_m).toBe(1);
  expect(dragged(["house"], "vertex2", [5, 5, 3]).footprints?.[0]?.polygon[2]).toEqual([5, 5]);
  expect(dragged(["house"], "between0", [2, -1, 3]).footprints?.[0]?.polygon).toEqual([[0, 0], [2, -1], [4, 0], [4, 2]]);
  expect(dragged(["kiosk"], "top", [0, 0, 2.5]).models?.[0]?.scale).toBe(2.5);
  expect(dragged(["kiosk"], "corner2", [2, 2, 1]).models?.[0]?.scale).toBe(2);
});
