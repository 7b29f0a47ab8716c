// Two pictures of one moment bring two clocks into step.

import { expect, test } from "vitest";
import type { DraftCamera } from "../draft";
import { aheadSecs, inStep, timeOfFile, timeOfRunning, waysOf } from "./moment";

const file = (source: DraftCamera["source"], clock: DraftCamera["clock"] = {}) => ({ source: { path: "/a", ...source }, clock });
const camera = (source: DraftCamera["source"]): DraftCamera => ({ id: "a", name: "a", source, clock: {}, isEnabled: true, origin: "new" });

test("files without a time of their own are compared by where their parts begin", () => {
  const first = timeOfFile(file({ from_secs: 2 }), 5);
  const second = timeOfFile(file({ from_secs: 0 }, { offset_secs: 1 }), 4.25);
  expect(aheadSecs(first, second)).toBeCloseTo(2.25);
  const clock = inStep({ offset_secs: 1 }, 2.25);
  expect(clock.offset_secs).toBe(-1.25);
  expect(aheadSecs(first, timeOfFile(file({}, clock), 4.25))).toBeCloseTo(0);
});

test("files that say when they were recorded keep their times, whatever part is played", () => {
  const first = timeOfFile(file({ start: "2026-03-01T12:00:00Z", from_secs: 30 }), 40);
  const second = timeOfFile(file({ start: "2026-03-01T12:00:10Z" }), 31.5);
  expect(aheadSecs(first, second)).toBeCloseTo(1.5);
  expect(aheadSecs(first, timeOfFile(file({}), 3))).toBeNull();
});

test("drift counts from its instant on", () => {
  const time = timeOfFile(file({ start: "2026-03-01T12:00:00Z" }, { drift_ppm: 1_000, since: "2026-03-01T12:00:00Z" }), 100);
  expect(time.secs - Date.parse("2026-03-01T12:00:00Z") / 1e3).toBeCloseTo(100.1);
});

test("a running camera's time follows the draft's clock", () => {
  expect(timeOfRunning(100, { offset_secs: 1 }, { offset_secs: 3 }).secs).toBe(102);
});

test("pictures are compared by what both have", () => {
  const of = (source: DraftCamera["source"], isRunning: boolean) => ({ camera: camera(source), isRunning });
  expect(waysOf(of({ path: "/a" }, false), of({ path: "/b" }, true))).toEqual(["file", "file"]);
  expect(waysOf(of({ url: "rtsp://a" }, true), of({ path: "/b" }, true))).toEqual(["running", "running"]);
  expect(waysOf(of({ url: "rtsp://a" }, true), of({ path: "/b", start: "2026-03-01T12:00:00Z" }, false))).toEqual(["running", "file"]);
  expect(waysOf(of({ url: "rtsp://a" }, true), of({ path: "/b" }, false))).toBeNull();
});
