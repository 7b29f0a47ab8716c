// What hangs on a camera's id goes with it.

import { expect, test } from "vitest";
import type { Calibration, Draft } from "../draft";
import { placeOf, withEnd, withId, withName, withNewCamera, withoutCamera, withPace, withStream } from "./edits";

const calibration = { focal_px: [1, 1] } as unknown as Calibration;
const start: Draft = { scene: { id: "s", document: { version: 1 } }, cameras: [], removedCameras: [], calibrating: {} };

test("the id of a new camera follows its name until it is written", () => {
  const added = withNewCamera(start, "path");
  expect(added.id).toBe("camera");
  const named = withName(added.draft, "camera", "North gate", false);
  expect(named.id).toBe("north-gate");
  expect(named.draft.cameras[0]).toMatchObject({ id: "north-gate", name: "North gate" });
  const own = withId(named.draft, "north-gate", "n1");
  expect(withName(own, "n1", "South gate", false).id).toBe("n1");
  expect(withName(named.draft, "north-gate", "South gate", true).id).toBe("north-gate");
});

test("a second camera takes another id", () => {
  const one = withName(withNewCamera(start, "url").draft, "camera", "Gate", false).draft;
  const two = withNewCamera(one, "url");
  expect(withName(two.draft, two.id, "Gate", false).id).toBe("gate-2");
});

test("calibration and pairs go with the id, and away with the camera", () => {
  const added = withNewCamera(start, "path").draft;
  const pairs = { pairs: [], lines: [], findsFocal: true, findsK1: false };
  const whole: Draft = { ...added, calibrating: { camera: pairs }, scene: { id: "s", document: { version: 1, cameras: [{ id: "camera", calibration }] } } };
  const moved = withId(whole, "camera", "gate");
  expect(moved.calibrating).toEqual({ gate: pairs });
  expect(moved.scene.document.cameras).toEqual([{ id: "gate", calibration }]);
  const gone = withoutCamera(moved, "gate");
  expect([gone.cameras, gone.calibrating, gone.scene.document.cameras]).toEqual([[], {}, []]);
});

test("which part is played does not change what a source shows", () => {
  expect(placeOf({ path: "/a", from_secs: 1, until_secs: 2, end: "loop", start: "x", rate_hz: 5 })).toEqual({ path: "/a", rate_hz: 5 });
  expect(placeOf({ path: "/a", pace: "all" })).toEqual({ path: "/a" });
});

test("a loop plays in real time, and a file whose every frame counts ends with its last", () => {
  expect(withPace({ path: "/a", end: "loop" }, "all")).toEqual({ path: "/a", end: "stop", pace: "all" });
  expect(withPace({ path: "/a", end: "stop", pace: "all" }, "real_time")).toEqual({ path: "/a", end: "stop" });
  expect(withEnd({ path: "/a", end: "stop", pace: "all" }, "loop")).toEqual({ path: "/a", end: "loop" });
  expect(withEnd({ path: "/a", pace: "all" }, "stop")).toEqual({ path: "/a", end: "stop", pace: "all" });
});

test("a stream is taken over with the name of its login, and its camera's name where there is none", () => {
  const added = withNewCamera(start, "url");
  const first = withStream(added.draft, added.id, { url: "rtsp://10.0.0.7/a", credentials: "gates", name: "North gate" }, false);
  expect(first.id).toBe("north-gate");
  expect(first.draft.cameras[0]).toMatchObject({ name: "North gate", source: { url: "rtsp://10.0.0.7/a", credentials: "gates" } });
  const second = withStream(first.draft, first.id, { url: "rtsp://10.0.0.8/a", credentials: "", name: "South gate" }, false);
  expect(second.draft.cameras[0]).toMatchObject({ id: "north-gate", name: "North gate" });
  expect(second.draft.cameras[0]?.source).toEqual({ url: "rtsp://10.0.0.8/a" });
  expect(withStream(first.draft, "other", { url: "rtsp://10.0.0.8/a", credentials: "", name: "" }, false).draft).toBe(first.draft);
});
