// One moment in the pictures of two cameras, and what it says of their clocks.

import type { DraftCamera } from "../draft";

/** A time by which two cameras can be compared: of the world, or since the daemon began to play files that have no time of their own. */
export type SceneTime = { readonly of: "world" | "start"; readonly secs: number };

/** When a frame of a file is shown, as the draft has its clock; `positionSecs` after the file's first frame. */
export function timeOfFile({ source, clock }: Pick<DraftCamera, "source" | "clock">, positionSecs: number): SceneTime {
  const start = source.start === undefined ? null : Date.parse(source.start) / 1e3;
  const own = start === null ? positionSecs - (source.from_secs ?? 0) : start + positionSecs;
  const since = clock.since ? Date.parse(clock.since) / 1e3 : (start ?? 0);
  const drift = (clock.drift_ppm ?? 0) * 1e-6 * (own - since);
  return { of: start === null ? "start" : "world", secs: own + (clock.offset_secs ?? 0) + drift };
}

/** When a frame of a camera that runs would be shown: the daemon's word holds the clock that is kept, the draft may have another. */
export function timeOfRunning(sceneSecs: number, kept: DraftCamera["clock"], drafted: DraftCamera["clock"]): SceneTime {
  return { of: "world", secs: sceneSecs + (drafted.offset_secs ?? 0) - (kept.offset_secs ?? 0) };
}

/** By how much the second's clock is ahead, where both show the same moment; null where their times cannot be compared. */
export function aheadSecs(first: SceneTime, second: SceneTime): number | null {
  return first.of === second.of ? second.secs - first.secs : null;
}

/** The clock that brings a camera into step which is ahead by so much. To the millisecond: no frame is known better. */
export function inStep(clock: DraftCamera["clock"], ahead: number): DraftCamera["clock"] {
  return { ...clock, offset_secs: Math.round(((clock.offset_secs ?? 0) - ahead) * 1e3) / 1e3 };
}

/** How two cameras are looked at side by side. */
export type Way = "file" | "running";

type Candidate = { readonly camera: DraftCamera; readonly isRunning: boolean };

/** By which pictures two cameras can be compared; null where by none. */
export function waysOf(first: Candidate, second: Candidate): readonly [Way, Way] | null {
  const isFile = ({ camera: { source } }: Candidate) => Boolean(source.path);
  const isTimed = ({ camera: { source } }: Candidate) => source.start !== undefined;
  if (isFile(first) && isFile(second) && isTimed(first) === isTimed(second)) return ["file", "file"];
  if (first.isRunning && second.isRunning) return ["running", "running"];
  if (isFile(first) && isTimed(first) && second.isRunning) return ["file", "running"];
  if (first.isRunning && isFile(second) && isTimed(second)) return ["running", "file"];
  return null;
}
