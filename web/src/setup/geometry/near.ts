// What is near a pointer, for snapping, as the stage stands.

import type { Point } from "../../operate/orbit";
import type { Eye } from "./eye";
import { type Near, NOTHING_NEAR, targetsOf } from "./snapping";
import { fileExtents, grid, hidden, shown } from "./state";

const SNAP_PX = 9;

/** How much larger than usual texts are on this screen: what is drawn and grasped is as much larger. */
export function enlarged(): number {
  return typeof document === "undefined" ? 1 : (Number.parseFloat(getComputedStyle(document.documentElement).fontSize) || 16) / 16;
}

/** What is near a place, for snapping; nothing while Alt is held. */
export function nearTo(eye: Eye, place: Point, event: PointerEvent, except: readonly string[]): Near {
  if (event.altKey) return NOTHING_NEAR;
  const left = new Set([...except, ...hidden.value]);
  return { targets: targetsOf(shown.value, left, fileExtents.value), reach: SNAP_PX * enlarged() * eye.metresPerPx(place), grid: grid.value };
}
