// Things are moved, turned, copied, renamed and removed whatever their kind, and nothing else changes.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { add, duplicate, extentOfAll, idFault, move, remove, rename, tidyTurn, turn } from "./operations";
import { extentOf, idAt, pointerOf, thing, things } from "./things";

const DOCUMENT: SceneDocument = {
  version: 1,
  boxes: [{ id: "hall", center_m: [10, 0, 2], size_m: [4, 2, 4], yaw_deg: 170 }, { id: "shed", center_m: [0, 0, 1], size_m: [2, 2, 2] }],
  cylinders: [{ id: "tank", base_m: [5, 5, 0], radius_m: 1, height_m: 3 }],
  footprints: [{ id: "house", polygon: [[0, 0], [4, 0], [4, 2]], top_m: 3 }],
  models: [{ id: "kiosk", file: "assets/kiosk.glb" }],
};

test("things are found by id and by pointer", () => {
  expect(things(DOCUMENT).map(({ of }) => of.id)).toEqual(["hall", "shed", "tank", "house", "kiosk"]);
  expect(pointerOf(DOCUMENT, "shed")).toBe("/boxes/1");
  expect(idAt(DOCUMENT, "/boxes/1/size_m/0")).toBe("shed");
  expect(idAt(DOCUMENT, "/ground/0")).toBeNull();
  expect(thing(DOCUMENT, "nothing")).toBeNull();
});

test("all kinds move", () => {
  const after = move(DOCUMENT, ["hall", "tank", "house", "kiosk"], [0.1, 0.2, 0.3]);
  expect(after.boxes?.[0]?.center_m).toEqual([10.1, 0.2, 2.3]);
  expect(after.boxes?.[1]).toBe(DOCUMENT.boxes?.[1]);
  expect(after.cylinders?.[0]?.base_m).toEqual([5.1, 5.2, 0.3]);
  expect(after.footprints?.[0]).toMatchObject({ polygon: [[0.1, 0.2], [4.1, 0.2], [4.1, 2.2]], base_m: 0.3, top_m: 3.3 });
  expect(after.models?.[0]?.position_m).toEqual([0.1, 0.2, 0.3]);
  expect(move(DOCUMENT, ["hall"], [0, 0, 0])).toBe(DOCUMENT);
  expect(move(DOCUMENT, ["nothing"], [1, 0, 0])).toBe(DOCUMENT);
});

test("what is turned goes round, and its own turn stays between -180 and 180", () => {
  const after = turn(DOCUMENT, ["hall", "house"], [0, 0], 90);
  expect(after.boxes?.[0]).toMatchObject({ center_m: [0, 10, 2], yaw_deg: -100 });
  expect(after.footprints?.[0]?.polygon).toEqual([[0, 0], [0, 4], [-2, 4]]);
  expect([540, -540, 359, 90].map(tidyTurn)).toEqual([-180, -180, -1, 90]);
});

test("copies have ids of their own", () => {
  const { document, copies } = duplicate(DOCUMENT, ["shed", "house"], [1, 0, 0]);
  expect(copies).toEqual(["shed-2", "house-2"]);
  expect(document.boxes?.[2]).toEqual({ id: "shed-2", center_m: [1, 0, 1], size_m: [2, 2, 2] });
  expect(duplicate(document, ["shed-2"], [1, 0, 0]).copies).toEqual(["shed-3"]);
});

test("ids are unique among all that stands", () => {
  expect(idFault(DOCUMENT, "hall", "tank")).toBe("taken");
  expect(idFault(DOCUMENT, "hall", "hall")).toBeNull();
  expect(idFault(DOCUMENT, "hall", "Hall 2")).toBe("form");
  expect(rename(DOCUMENT, "hall", "tank")).toBe(DOCUMENT);
  expect(rename(DOCUMENT, "tank", "silo").cylinders?.[0]?.id).toBe("silo");
});

test("things come and go", () => {
  const box = { list: "boxes", of: { id: "new", center_m: [0, 0, 0], size_m: [1, 1, 1] } } as const;
  const after = add({ version: 1 }, { list: "boxes", of: { ...box.of, center_m: [0, 0, 0], size_m: [1, 1, 1] } });
  expect(after.boxes).toHaveLength(1);
  expect(remove(after, ["new"]).boxes).toEqual([]);
  expect(remove(DOCUMENT, ["nothing"])).toBe(DOCUMENT);
});

test("several things have one extent", () => {
  const extent = extentOfAll(DOCUMENT, ["shed", "tank"]);
  expect(extent).toMatchObject({ low: 0, high: 3, middle: [2.5, 2.5] });
  expect(extentOfAll(DOCUMENT, [])).toBeNull();
  const [shed] = things(DOCUMENT).slice(1);
  expect(shed && extentOf(shed).outline).toEqual([[-1, -1], [1, -1], [1, 1], [-1, 1]]);
});
