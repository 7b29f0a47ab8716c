// Asks the daemon how far the clocks and calibrations of the scene's cameras are apart.

import { useState } from "preact/hooks";
import { api, content, told } from "../ask";
import type { components } from "../contract.gen";
import { base, draft } from "./draft";

export type CalibrationOffset = {
  offset_m: number; offset_error_m: number; apart_m: number; apart_corrected_m: number; paths: number; is_used: boolean;
  corrected: components["schemas"]["Calibration"] | null;
};

export type Line = {
  camera: string; ahead_secs: number | null; confidence: number | null;
  clock: components["schemas"]["ClockSettings"] | null; calibration: CalibrationOffset | null;
};

/** What the daemon answered last, and how to ask it; it can only tell of a scene that is kept, with cameras to compare. */
export function useAlignment() {
  const [lines, setLines] = useState<readonly Line[] | null>(null);
  const [failure, setFailure] = useState<string | null>(null);
  const [isAsking, setAsking] = useState(false);
  const isPossible = base.value?.sceneTag !== null && (base.value?.scene?.cameras?.length ?? 0) > 1;
  const ask = async () => {
    const id = draft.value?.scene.id;
    if (id === undefined) return;
    setAsking(true);
    try {
      setLines((await content(api.GET("/api/v1/scenes/{id}/alignment", { params: { path: { id } } }))).cameras);
      setFailure(null);
    } catch (error) {
      setFailure(told(error));
    } finally {
      setAsking(false);
    }
  };
  return { lines, failure, isPossible, isAsking, ask };
}
