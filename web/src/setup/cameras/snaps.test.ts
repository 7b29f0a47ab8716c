// Corners are found on the screen before edges, edges before the grid, and nothing that is hidden.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import type { Point } from "../../operate/orbit";
import * as s from "./snaps";

const SCENE: SceneDocument = {
  version: 1,
  ground: [{ polygon: [[-10, -10], [10, -10], [10, 10], [-10, 10]], imagery: { file: "a", control_points: [{ pixel: [1, 1], world: [3, 3] }] } }],
  boxes: [{ id: "hall", center_m: [0, 0, 2], size_m: [4, 2, 4], yaw_deg: 90 }],
  cylinders: [{ id: "tank", base_m: [5, 5, 0], radius_m: 1, height_m: 3 }],
  footprints: [{ id: "shed", polygon: [[-5, -5], [-4, -5], [-4, -4]], top_m: 2 }],
};
const near = (a: Point | undefined, b: Point) => b.forEach((value, i) => expect(a?.[i]).toBeCloseTo(value, 9));

test("all corners and edges of a scene are known", () => {
  const corners = s.corners(SCENE);
  expect(corners).toHaveLength(1 + 4 + 8 + 6 + 8);
  near(corners.find(({ of, corner, isTop }) => of === "box" && corner === 1 && isTop)?.place, [1, -2, 4]);
  near(corners.find(({ of }) => of === "imagery")?.place, [3, 3, 0]);
  expect(s.edges(SCENE)).toHaveLength(4 + 12 + 9);
});

test("a pointer from above means corners, then edges, then the grid", () => {
  // Seen from straight above, ten pixels a metre.
  const above = (x: number, y: number, isHidden?: (place: Point) => boolean) =>
    s.snapped({ corners: s.corners(SCENE), edges: s.edges(SCENE) }, {
      at: [x * 10, y * 10], onScreen: ([px, py]) => [px * 10, py * 10], origin: [x, y, 50], direction: [0, 0, -1], met: [x, y, 0], grid_m: 5, ...(isHidden && { isHidden }),
    });
  near(above(9.5, 9.5)?.place, [10, 10, 0]);
  expect(above(9.5, 3)?.of).toBe("edge");
  near(above(9.5, 3)?.place, [10, 3, 0]);
  expect(above(-5.2, 4.9)).toEqual({ of: "grid", name: "", corner: 0, isTop: false, place: [-5, 5, 0] });
  expect(above(-7, 2)).toBeNull();
  expect(above(9.5, 9.5, () => true)?.of).not.toBe("ground");
});

test("the place on an edge is the one nearest to the line of sight", () => {
  near(s.alongEdge([[0, 0, 0], [0, 0, 4]], [5, 0, 3], [-1, 0, 0]), [0, 0, 3]);
  near(s.alongEdge([[0, 0, 0], [0, 0, 4]], [5, 0, 9], [-1, 0, 0]), [0, 0, 4]);
});

test("steps are round", () => {
  expect([0.03, 0.3, 1, 7, 4000].map(s.step)).toEqual([0.1, 0.5, 1, 10, 1000]);
});
