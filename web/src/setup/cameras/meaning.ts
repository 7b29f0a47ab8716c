// What a point of the scene pane means: a corner, an edge or a grid point near it, else what stands there.

import type { Point } from "../../operate/orbit";
import { eye } from "./eyeing";
import type { Pixel } from "./pairs";
import { known, met } from "./scene";
import { type Snap, snapped, step } from "./snaps";
import { length, minus, unit } from "./torch";

/** Grid points are at least so far apart on the screen. */
const GRID_PX = 36;
/** What hides a corner stands nearer than that by this share and this length. */
const NEARER = { share: 0.005, metres: 0.02 } as const;

export type Meant = { readonly place: Point; readonly snap: Snap | null };

/** The place that a point of the pane means; null where it means none. `isExact`: whatever lies there, without snapping. */
export function meant(at: Pixel, isExact = false): Meant | null {
  const from = eye.value;
  if (!from) return null;
  const { from: origin, along } = from.ray(at);
  const hit = met({ origin, direction: along });
  if (isExact) return hit && { place: hit.place, snap: null };
  const snap = snapped(known.value, {
    at, onScreen: from.place, origin, direction: along, met: hit?.place ?? null,
    grid_m: hit ? step(GRID_PX * from.metresPerPx(hit.place)) : null,
    isHidden: (place) => {
      const away = length(minus(place, origin));
      const before = met({ origin, direction: unit(minus(place, origin)) });
      return before !== null && before.distance_m < away * (1 - NEARER.share) - NEARER.metres;
    },
  });
  return snap ? { place: snap.place, snap } : hit && { place: hit.place, snap: null };
}
