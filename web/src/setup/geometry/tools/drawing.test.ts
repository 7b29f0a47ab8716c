// Things are drawn by dragging or by clicks; what crosses itself or is a slip of the hand is not taken.

import { expect, test } from "vitest";
import type { Corner } from "../../plan/frame";
import { back, begin, close, outlineOf, pointTo, setCorner, withHeight, type Drawing, type Drawn } from "./drawing";
import { made } from "./made";

const GIVEN = { height: 3, thickness: 0.2 };
function drawn(tool: Drawn, corners: Corner[], yaw = 0): Drawing {
  const [first = [0, 0], ...rest] = corners;
  return rest.reduce((of, at) => setCorner(pointTo(of, at), at), begin(tool, first, 1, { ...GIVEN, yaw }));
}

test("a box has two opposite corners, and stands on its base", () => {
  const box = drawn("box", [[4, 2], [0, 0]]);
  expect(box.stage).toBe("height");
  expect(made(withHeight(box, 2), "box")).toEqual({
    list: "boxes", of: { id: "box", center_m: [2, 1, 2], size_m: [4, 2, 2], yaw_deg: 0, color_srgb: "#b0a080" },
  });
  expect(drawn("box", [[0, 0], [4, 0.01]])).toMatchObject({ stage: "outline", fault: "small" });
});

test("a box that is begun on a turned edge is turned as it", () => {
  const { of } = made(drawn("box", [[0, 0], [0, 4]], 45), "box");
  expect(of).toMatchObject({ center_m: [0, 2, 2.5], yaw_deg: 45 });
  expect((of as { size_m: number[] }).size_m[0]).toBeCloseTo(Math.SQRT2 * 2, 3);
});

test("a cylinder has a middle and a rim", () => {
  expect(made(drawn("cylinder", [[1, 1], [1, 3]]), "tank").of).toMatchObject({ base_m: [1, 1, 1], radius_m: 2, height_m: 3 });
});

test("a wall along one line is a box, along several a footprint", () => {
  expect(made(close(drawn("wall", [[0, 0], [0, 4]])), "wall")).toMatchObject({ list: "boxes", of: { center_m: [0, 2, 2.5], size_m: [4, 0.2, 3], yaw_deg: 90 } });
  expect(made(close(drawn("wall", [[0, 0], [4, 0], [4, 4]])), "wall")).toMatchObject({ list: "footprints", of: { base_m: 1, top_m: 4 } });
  expect(close(begin("wall", [0, 0], 0, GIVEN)).fault).toBe("few");
});

test("a footprint closes on its first corner or when it is ended", () => {
  const three: Corner[] = [[0, 0], [4, 0], [4, 2]];
  expect(drawn("footprint", [...three, [0.01, 0]]).stage).toBe("height");
  const closed = close(drawn("footprint", three));
  expect(made(closed, "house").of).toMatchObject({ polygon: three, base_m: 1, top_m: 4 });
  expect(outlineOf(pointTo(drawn("footprint", three), [1, 2]))).toHaveLength(4);
});

test("an outline that crosses itself is not taken", () => {
  expect(drawn("footprint", [[0, 0], [4, 4], [4, 0], [0, 4]]).fault).toBe("crossing");
  // The edge that closes it would cross.
  expect(close(drawn("footprint", [[0, 0], [4, 0], [4, 4], [6, 4], [6, 2]]))).toMatchObject({ stage: "outline", fault: "crossing" });
});

test("steps are taken back", () => {
  const wall = close(drawn("wall", [[0, 0], [4, 0]]));
  const before = back(wall);
  expect(before).toMatchObject({ stage: "outline", corners: [[0, 0], [4, 0]] });
  const one = before && back(before);
  expect(one?.corners).toEqual([[0, 0]]);
  expect(one && back(one)).toBeNull();
  expect(back(drawn("box", [[0, 0], [1, 1]]))?.corners).toEqual([[0, 0]]);
});
