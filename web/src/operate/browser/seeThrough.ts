// Which buildings open, so that whom they hide from the viewer is seen through them: the twin of src/plan/see_through.rs. Plain
// functions and what is remembered from picture to picture; knows nothing of three.js.

import type { Ray } from "../../spatial/lens";
import type { Point } from "../orbit";
import type { Upright } from "./upright";

/** Opacity of what is open. */
const OPEN_OPACITY = 0.3;
/** Share of somebody's points that something hides from which on it opens, and down to which it stays so. */
const OPENS_AT = 0.5;
const CLOSES_BELOW = 0.25;
/** Time in which all but 5 % of a change is done. */
const SETTLED_MILLIS = 500;
/** Nearer to full opacity it is as good as closed, and nearer to what it comes to it is there. */
const CLOSED_OPACITY = 0.99;
/** Where on the rectangle somebody is looked for: shares of half its width, and of its height. */
const LOOKED_AT = [[0, 0.06], [0, 0.3], [0, 0.55], [0, 0.8], [0, 0.97], [-0.7, 0.6], [0.7, 0.6]] as const;
const NEAR_M = 0.02;

/** Somebody as drawn: the rectangle, and where it stands. */
export type Standing = { readonly upright: Upright; readonly place: Point };
/** What of a scene can open that a ray crosses before so many metres, each once. */
export type Crossed = (ray: Ray, reachM: number) => readonly string[];
/** By thing: the greatest share of one that it hides, and of whom it hides a part. */
export type Hiding = ReadonlyMap<string, { readonly share: number; readonly hides: ReadonlySet<number> }>;

/** What hides whom from `eye`. What somebody stands on (`stoodUpon`) hides nobody. */
export function hidingOf(standing: readonly Standing[], eye: Point, crossed: Crossed, stoodUpon: ReadonlySet<string> = new Set()): Hiding {
  const found = new Map<string, { share: number; hides: Set<number> }>();
  standing.forEach(({ upright: { right, halfWidth, height }, place }, i) => {
    const counts = new Map<string, number>();
    for (const [across, up] of LOOKED_AT) {
      const by = across * halfWidth;
      const origin: Point = [place[0] + right[0] * by, place[1] + right[1] * by, place[2] + up * height];
      const to = [eye[0] - origin[0], eye[1] - origin[1], eye[2] - origin[2]] as const;
      const reach = Math.hypot(...to);
      if (!(reach > NEAR_M)) continue;
      for (const key of crossed({ origin, direction: [to[0] / reach, to[1] / reach, to[2] / reach] }, reach)) {
        if (!stoodUpon.has(key)) counts.set(key, (counts.get(key) ?? 0) + 1);
      }
    }
    for (const [key, count] of counts) {
      const of = found.get(key) ?? { share: 0, hides: new Set<number>() };
      of.share = Math.max(of.share, count / LOOKED_AT.length);
      of.hides.add(i);
      found.set(key, of);
    }
  });
  return found;
}

/** How far everything has opened, from picture to picture. */
export class Openings {
  private readonly now = new Map<string, { opacity: number; isOpen: boolean }>();
  private at: number | null = null;

  /** Goes on to `millis`; false once nothing moves any more. The first time everything is as it will be. */
  step(hiding: Hiding, millis: number): boolean {
    const passed = this.at === null ? Infinity : Math.max(0, millis - this.at);
    this.at = millis;
    // Three time constants leave 5 %.
    const gain = 1 - Math.exp((-3 * passed) / SETTLED_MILLIS);
    for (const key of hiding.keys()) if (!this.now.has(key)) this.now.set(key, { opacity: 1, isOpen: false });
    let isMoving = false;
    for (const [key, one] of this.now) {
      const share = hiding.get(key)?.share ?? 0;
      one.isOpen = share >= (one.isOpen ? CLOSES_BELOW : OPENS_AT);
      const settled = one.isOpen ? OPEN_OPACITY : 1;
      one.opacity += (settled - one.opacity) * gain;
      if (Math.abs(settled - one.opacity) < 1 - CLOSED_OPACITY) one.opacity = settled;
      isMoving ||= one.opacity !== settled;
      if (!one.isOpen && one.opacity === 1) this.now.delete(key);
    }
    return isMoving;
  }

  /** Opacity of what is not closed, below 1. */
  get opacities(): ReadonlyMap<string, number> {
    return new Map([...this.now].filter(([, { opacity }]) => opacity < 1).map(([key, { opacity }]) => [key, opacity]));
  }
}
