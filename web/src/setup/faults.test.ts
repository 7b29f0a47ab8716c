// Pointers lead to the stage, the thing and the field that they belong to, and a fault is over once its place was changed.

import { beforeEach, expect, test } from "vitest";
import * as d from "./draft";
import { atCamera, atThing, found, open, placed } from "./faults";

const START: d.Draft = {
  scene: { id: "yard", document: { version: 1, ground: [{ polygon: [[0, 0], [1, 1], [1, 0]] }], boxes: [{ id: "hall", center_m: [0, 0, 0], size_m: [1, 1, 0] }] } },
  cameras: [{ id: "gate", name: "Gate", source: { path: "/nowhere" }, clock: {}, isEnabled: true, origin: "new" }],
  removedCameras: [], calibrating: {},
};

beforeEach(() => d.begin(START, { sceneTag: null, scene: null, cameras: [], cameraTags: {} }));

test("pointers lead to their places", () => {
  const scene = (pointer: string) => placed(START, { kind: "scene" }, { pointer, detail: "no" });
  expect(scene("/boxes/0/size_m/2")).toMatchObject({ stage: "geometry", details: { thing: "hall" }, field: "size_m/2", value: 0 });
  expect(scene("/ground/0/polygon/2")).toMatchObject({ stage: "ground", details: { ground: "0" }, field: "polygon/2" });
  expect(scene("/origin/latitude_deg")).toMatchObject({ stage: "ground", field: "origin/latitude_deg" });
  expect(scene("/view/eye_m")).toMatchObject({ stage: null, field: "view/eye_m" });
  expect(placed(START, { kind: "camera", id: "gate" }, { pointer: "/source/path", detail: "no file" }))
    .toMatchObject({ stage: "videos", details: { camera: "gate" }, field: "source/path", value: "/nowhere" });
});

test("a fault is over once something else stands there", () => {
  found.value = [
    placed(START, { kind: "camera", id: "gate" }, { pointer: "/source/path", detail: "no file" }),
    placed(START, { kind: "scene" }, { pointer: "/ground/0/polygon/2", detail: "crosses" }),
  ];
  expect(atCamera("gate", "source")).toBe("no file");
  expect(atThing("ground", { ground: "0" }, "polygon")).toBe("crosses");
  d.editCamera("gate", "path", (camera) => ({ ...camera, source: { path: "/there" } }));
  expect(open.value.map(({ stage }) => stage)).toEqual(["ground"]);
  d.undo();
  expect(open.value).toHaveLength(2);
});
