// The way from one view to another, shown as a flight, so that the viewer sees where they are taken.

import { type View, between } from "./orbit";
import * as state from "./state";

const FLIGHT_MILLIS = 700;

const isReduced = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
let frame = 0;

/** Flies to `to`; what is in the address stays. Resolves on arrival, at once where people do not want motion. */
export function flyTo(to: View): Promise<void> {
  const from = state.looking.peek();
  cancelAnimationFrame(frame);
  if (!from || isReduced()) return Promise.resolve();
  const start = performance.now();
  return new Promise((arrived) => {
    const step = (now: number) => {
      const share = Math.min((now - start) / FLIGHT_MILLIS, 1);
      state.flight.value = between(from, to, share * share * (3 - 2 * share));
      if (share < 1) frame = requestAnimationFrame(step);
      else arrived();
    };
    frame = requestAnimationFrame(step);
  });
}

/** Flies there and stays. */
export async function goTo(to: View): Promise<void> {
  await flyTo(to);
  state.setView(to);
  state.flight.value = null;
}

/** Flies back to where the viewer stood before. */
export async function flyBack(): Promise<void> {
  const stood = state.view.peek();
  if (stood && state.flight.peek()) await flyTo(stood);
  state.flight.value = null;
}
