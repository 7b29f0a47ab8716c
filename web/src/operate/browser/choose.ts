// Who draws the fused view: this browser, or the daemon. The address says what is wished for (`drawing`); left to itself, the browser
// draws where it keeps up, and the daemon where it does not. Knows nothing of three.js, so that whoever is not drawn for loads none.

import { computed, signal } from "@preact/signals";
import { type Graphics, graphics } from "../../spatial/graphics";
import * as state from "../state";

export type By = "browser" | "server";
/** Why: a key of the texts beneath `spatial.why.`. */
export type Why = "wished" | "fast" | "measuring" | "slow" | "none" | "software" | "past" | "lost" | "points" | "hulls" | "auto" | "effects";
export type Choice = { readonly by: By; readonly why: Why };

/** Fewer pictures a second are too few. */
export const LEAST_RATE = 15;
/** The first seconds are measured, after what is made ready first. */
export const MEASURE_MILLIS = 3_000;

/** Pictures a second that the browser drew; null until that was measured. */
export const rate = signal<number | null>(null);
/** Whether the graphics card was lost, and has not come back. */
export const isLost = signal(false);

/** Who draws, and why, as a plain function. */
export function decide(given: {
  wish: "auto" | By;
  graphics: Graphics;
  rate: number | null;
  isPast: boolean;
  isLost: boolean;
  entities: string;
  hasEffects: boolean;
}): Choice {
  const { wish } = given;
  if (wish === "server") return { by: "server", why: "wished" };
  if (given.graphics === "none") return { by: "server", why: "none" };
  if (given.isLost) return { by: "server", why: "lost" };
  // Cameras tell what moves as it does; of the past the daemon knows more.
  if (given.isPast) return { by: "server", why: "past" };
  const { entities } = given;
  if (entities === "points" || entities === "hulls" || entities === "auto") return { by: "server", why: entities };
  if (given.hasEffects) return { by: "server", why: "effects" };
  if (wish === "browser") return { by: "browser", why: "wished" };
  if (given.graphics === "software") return { by: "server", why: "software" };
  if (given.rate === null) return { by: "browser", why: "measuring" };
  return given.rate < LEAST_RATE ? { by: "server", why: "slow" } : { by: "browser", why: "fast" };
}

/** Who draws now. */
export const choice = computed((): Choice => decide({
  wish: state.drawing.value,
  graphics: graphics(),
  rate: rate.value,
  isPast: state.at.value !== null,
  isLost: isLost.value,
  entities: state.entities.value,
  hasEffects: Object.values(state.effects.value).some((value) => value !== "off"),
}));
