// What pointer and keys do in a scene that the browser draws: what they do in Operate, over the scene's own surfaces.

import { attach } from "../operate/gestures";
import type { View } from "../operate/orbit";
import { type Mode, taken } from "../operate/ways";
import type { Stage } from "./stage";
import type { Surfaces } from "./surfaces";

export { MODES, type Mode } from "../operate/ways";

type Given = {
  mode: Mode;
  move: (change: (view: View) => View) => void;
  reset: () => void;
  surfaces: () => Surfaces | null;
};

/** A pointer that moved less than this between down and up chose a place, pixels. */
const CLICK_PX = 5;

/** The height of what one would stand on there, coming from `above`; the ground's own where there is nothing. */
export function groundBelow(surfaces: Surfaces | null, x: number, y: number, above: number): number {
  return surfaces?.pick({ origin: [x, y, above], direction: [0, 0, -1] })?.point_m[2] ?? 0;
}

/** Lets the stage be moved in; answers what undoes that. */
export function control(stage: Stage, { mode, move, reset, surfaces }: Given): () => void {
  const groundAt = (x: number, y: number, above: number) => groundBelow(surfaces(), x, y, above);
  if (mode !== "orbit") move((view) => taken(view, mode, (x, y) => groundAt(x, y, view.eye[2])));
  return attach(stage.host, {
    mode: () => mode,
    move: (change) => {
      if (!stage.isHeld) move(change);
    },
    reset,
    choose: () => {},
    groundAt,
  });
}

/** Calls `onClick` where the pointer went down and up in one place. */
export function clicks(host: HTMLElement, onClick: (event: PointerEvent) => void): () => void {
  const ending = new AbortController();
  let down: readonly [number, number] | null = null;
  host.addEventListener("pointerdown", (event) => {
    down = event.button === 0 && event.isPrimary ? [event.clientX, event.clientY] : null;
  }, { signal: ending.signal });
  host.addEventListener("pointerup", (event) => {
    if (!down || !event.isPrimary) return;
    const isClick = Math.hypot(event.clientX - down[0], event.clientY - down[1]) < CLICK_PX;
    down = null;
    if (isClick) onClick(event);
  }, { signal: ending.signal });
  return () => ending.abort();
}
