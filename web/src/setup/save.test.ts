// Saving goes on where it stopped, loses nothing, and never replaces what somebody else did.

import { beforeEach, expect, test, vi } from "vitest";
import { Trouble } from "../ask";
import { changes, count } from "./changes";
import * as d from "./draft";
import { open } from "./faults";
import * as daemon from "./saving";
import { keepMine, result, save, takeTheirs } from "./save";

vi.mock("./saving", () => ({
  validate: vi.fn((_id: string, document: d.SceneDocument) => Promise.resolve(document)),
  putScene: vi.fn(() => Promise.resolve('"2"')),
  putCamera: vi.fn(() => Promise.resolve('"1"')),
  patchFeed: vi.fn(() => Promise.resolve('"1"')),
  removeCamera: vi.fn(() => Promise.resolve()),
  putFile: vi.fn(() => Promise.resolve()),
  cameraNow: vi.fn(() => Promise.resolve(null)),
  sceneNow: vi.fn(() => Promise.resolve(null)),
  lastChange: vi.fn(() => Promise.resolve({ by: "ann", at: "2026-03-01T12:00:00Z" })),
}));
const asked = vi.mocked(daemon);

const camera = (id: string, more: Partial<d.DraftCamera> = {}): d.DraftCamera =>
  ({ id, name: id, source: { path: `/${id}.webm` }, clock: {}, isEnabled: true, origin: "new", ...more });
const BASE: d.Base = { sceneTag: '"1"', scene: { version: 1 }, cameras: [camera("old", { origin: "kept" })], cameraTags: { old: '"7"' } };
const THEIRS: d.SceneDocument = { version: 1, name: "theirs" };

function pending(): number {
  const [of, from] = [d.draft.value, d.base.value];
  return of && from ? count(changes(of, from)) : NaN;
}

beforeEach(() => {
  vi.clearAllMocks();
  const scene = { id: "yard", document: { version: 1 as const, name: "mine" } };
  d.begin({ scene, cameras: [camera("a"), camera("b")], removedCameras: [], calibrating: {} }, BASE);
});

test("everything goes once, what is to go last", async () => {
  await save();
  expect(result.value).toMatchObject({ kind: "saved" });
  expect(asked.putCamera.mock.calls.map(([{ id }, tag]) => [id, tag])).toEqual([["a", null], ["b", null]]);
  expect(asked.putScene).toHaveBeenCalledWith("yard", { version: 1, name: "mine" }, '"1"');
  expect(asked.removeCamera).toHaveBeenCalledWith("old", '"7"');
  expect(pending()).toBe(0);
  await save();
  expect(asked.putCamera).toHaveBeenCalledTimes(2);
  expect(asked.putScene).toHaveBeenCalledTimes(1);
});

test("a lost connection in the middle loses nothing, and saving goes on", async () => {
  asked.putCamera.mockResolvedValueOnce('"1"').mockRejectedValueOnce(new Trouble("silent", 0));
  await save();
  expect(result.value).toEqual({ kind: "failed", message: "silent" });
  expect(d.base.value?.cameraTags).toMatchObject({ a: '"1"' });
  expect(asked.putScene).not.toHaveBeenCalled();
  // The daemon had taken it, and only its answer was lost.
  asked.putCamera.mockRejectedValueOnce(new Trouble("changed", 412));
  asked.cameraNow.mockResolvedValueOnce({ camera: camera("b", { origin: "kept" }), tag: '"4"' });
  await save();
  expect(result.value).toMatchObject({ kind: "saved" });
  expect(asked.putCamera.mock.calls.map(([{ id }]) => id)).toEqual(["a", "b", "b"]);
  expect(d.base.value?.cameraTags).toEqual({ a: '"1"', b: '"4"' });
});

test("faults stand at their places, and nothing was changed", async () => {
  asked.validate.mockRejectedValueOnce(new Trouble("wrong", 400, [{ pointer: "/name", detail: "too long" }]));
  await save();
  expect(result.value).toEqual({ kind: "faults" });
  expect(open.value.map(({ text, field }) => [text, field])).toEqual([["too long", "name"]]);
  expect(asked.putCamera).not.toHaveBeenCalled();
  d.editCamera("a", "path", (of) => ({ ...of, source: { path: "" } }));
  await save();
  expect(open.value.map(({ details, field }) => [details["camera"], field])).toEqual([["a", "source/path"]]);
});

test("what somebody else changed is told, and kept over only when that is asked for", async () => {
  asked.putScene.mockRejectedValueOnce(new Trouble("changed", 412));
  asked.sceneNow.mockResolvedValueOnce({ document: THEIRS, tag: '"9"' });
  await save();
  const told = result.value;
  if (told?.kind !== "conflict") throw new Error("no conflict");
  expect(told.conflict).toMatchObject({ kind: "scene", by: "ann", theirs: THEIRS });
  takeTheirs(told.conflict);
  expect(d.draft.value?.scene.document).toBe(THEIRS);
  d.undo();
  expect(d.draft.value?.scene.document.name).toBe("mine");
  keepMine(told.conflict);
  await save();
  expect(asked.putScene).toHaveBeenLastCalledWith("yard", { version: 1, name: "mine" }, '"9"');
  expect(pending()).toBe(0);
});

test("a scene whose answer was lost is not taken for somebody else's", async () => {
  asked.putScene.mockRejectedValueOnce(new Trouble("changed", 412));
  asked.sceneNow.mockResolvedValueOnce({ document: { name: "mine", version: 1 }, tag: '"2"' });
  await save();
  expect(result.value).toMatchObject({ kind: "saved" });
  expect(d.base.value?.sceneTag).toBe('"2"');
});
