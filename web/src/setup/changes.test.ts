// What is kept is what differs, and nothing else.

import { expect, test } from "vitest";
import { changes, count, equal, feedPatch, hasCome } from "./changes";
import type { Base, Draft, DraftCamera } from "./draft";

const camera = (id: string, more: Partial<DraftCamera> = {}): DraftCamera =>
  ({ id, name: id, source: { path: `/${id}.webm` }, clock: {}, isEnabled: true, origin: "kept", ...more });
const base: Base = { sceneTag: '"1"', scene: { version: 1, name: "Yard" }, cameras: [camera("a"), camera("b", { origin: "configured" })], cameraTags: {} };
const draft: Draft = { scene: { id: "yard", document: { version: 1, name: "Yard" } }, cameras: base.cameras, removedCameras: [], calibrating: {} };

test("order of members does not count, and what is undefined is not there", () => {
  expect(equal({ a: 1, b: [{ c: 2 }] }, { b: [{ c: 2 }], a: 1, d: undefined })).toBe(true);
  expect(equal([1, 2], [2, 1])).toBe(false);
  expect(equal([], {})).toBe(false);
});

test("an untouched draft changes nothing", () => {
  expect(count(changes(draft, base))).toBe(0);
});

test("what was added, changed and taken away is told apart", () => {
  const c = camera("c", { origin: "new" });
  const b = camera("b", { origin: "configured", clock: { offset_secs: 2 } });
  const of = changes({ ...draft, cameras: [b, c] }, base);
  expect(of).toEqual({ isScene: false, put: [c], patch: [b], remove: ["a"] });
  // A camera that was kept since is not new any more, whatever the draft's steps say of it.
  expect(count(changes({ ...draft, cameras: [...base.cameras, c] }, { ...base, cameras: [...base.cameras, camera("c")] }))).toBe(0);
});

test("a configured camera is changed by what differs alone", () => {
  const before = camera("b", { source: { path: "/b.webm", end: "loop", until_secs: 5 } });
  expect(feedPatch(before, { ...before, isEnabled: false, source: { path: "/b.webm", end: "stop" }, clock: { offset_secs: 1 } }))
    .toEqual({ enabled: false, source: { end: "stop", until_secs: null }, clock: { offset_secs: 1 } });
  expect(feedPatch(before, before)).toEqual({});
});

test("a change whose answer was lost is recognised", () => {
  const sent = camera("c", { source: { url: "rtsp://10.0.0.2/stream1", transport: "udp" } });
  expect(hasCome(sent, camera("c", { source: { url: "rtsp://10.0.0.2:554/…", transport: "udp", stall_secs: 5 }, clock: { offset_secs: 0 } }))).toBe(true);
  expect(hasCome(sent, camera("c", { source: { url: "rtsp://10.0.0.3/…", transport: "udp" } }))).toBe(false);
});
