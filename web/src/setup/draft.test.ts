// Steps are undone one by one, a drag is one step, and what was undone comes again until something else is done.

import { beforeEach, expect, test } from "vitest";
import * as d from "./draft";

const START: d.Draft = { scene: { id: "yard", document: { version: 1 } }, cameras: [], removedCameras: [], calibrating: {} };
const BASE: d.Base = { sceneTag: null, scene: { version: 1 }, cameras: [], cameraTags: {} };
const named = (name: string) => (document: d.SceneDocument) => ({ ...document, name });

beforeEach(() => d.begin(START, BASE));

test("steps are undone and done again", () => {
  d.editScene("one", named("one"));
  d.editScene("two", named("two"));
  expect(d.undoable.value).toBe("two");
  d.undo();
  expect(d.draft.value?.scene.document.name).toBe("one");
  expect(d.redoable.value).toBe("two");
  d.redo();
  expect(d.draft.value?.scene.document.name).toBe("two");
  d.undo();
  d.editScene("three", named("three"));
  expect(d.redoable.value).toBeNull();
  d.undo();
  d.undo();
  expect(d.draft.value).toBe(START);
  expect(d.undoable.value).toBeNull();
  d.undo();
  expect(d.draft.value).toBe(START);
});

test("a drag is one step until it settles", () => {
  d.editScene("drag", named("a"), "drag");
  d.editScene("drag", named("b"), "drag");
  d.settle();
  d.editScene("drag", named("c"), "drag");
  d.undo();
  expect(d.draft.value?.scene.document.name).toBe("b");
  d.undo();
  expect(d.draft.value).toBe(START);
});

test("what changes nothing is no step, and a draft knows whether it differs", () => {
  d.editScene("nothing", (document) => document);
  expect(d.undoable.value).toBeNull();
  expect(d.isDirty.value).toBe(false);
  d.editScene("name", named("yard"));
  expect(d.isDirty.value).toBe(true);
  d.undo();
  expect(d.isDirty.value).toBe(false);
});
