// What pointer, wheel and keys do to a view.

import { type View, moved, nearer, turned } from "./orbit";

type Change = (view: View) => View;
type Place = readonly [number, number];

const KEYS: Record<string, (view: View, shift: boolean) => View> = {
  ArrowLeft: (view, shift) => (shift ? moved(view, -0.05, 0) : turned(view, -0.06, 0)),
  ArrowRight: (view, shift) => (shift ? moved(view, 0.05, 0) : turned(view, 0.06, 0)),
  ArrowUp: (view, shift) => (shift ? moved(view, 0, 0.05) : turned(view, 0, 0.04)),
  ArrowDown: (view, shift) => (shift ? moved(view, 0, -0.05) : turned(view, 0, -0.04)),
  "+": (view) => nearer(view, 0.9),
  "=": (view) => nearer(view, 0.9),
  "-": (view) => nearer(view, 1 / 0.9),
};

/** Lets `stage` be turned and moved; answers what undoes that. */
export function attach(stage: HTMLElement, move: (change: Change) => void, reset: () => void): () => void {
  const ending = new AbortController();
  const { signal } = ending;
  // One pointer turns (with shift or another button it moves), two move and pinch.
  const pointers = new Map<number, Place>();
  stage.addEventListener("pointerdown", (event) => {
    if (event.target instanceof Element && event.target.closest("button")) return;
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }, { signal });
  stage.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const now: Place = [event.clientX, event.clientY];
    pointers.set(event.pointerId, now);
    const dx = (now[0] - before[0]) / stage.clientHeight;
    const dy = (now[1] - before[1]) / stage.clientHeight;
    if (other) {
      const apart = (place: Place) => Math.max(10, Math.hypot(place[0] - other[0], place[1] - other[1]));
      move((view) => nearer(moved(view, -dx / 2, dy / 2), apart(before) / apart(now)));
    } else if (event.shiftKey || event.buttons > 1) {
      move((view) => moved(view, -dx, dy));
    } else {
      move((view) => turned(view, -dx * 3, dy * 3));
    }
  }, { signal });
  for (const over of ["pointerup", "pointercancel"] as const) {
    stage.addEventListener(over, (event) => pointers.delete(event.pointerId), { signal });
  }
  stage.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30);
    move((view) => nearer(view, Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015)));
  }, { signal, passive: false });
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target !== stage) return;
    const key = KEYS[event.key];
    if (key) move((view) => key(view, event.shiftKey));
    else if (event.key === "0") reset();
    else return;
    event.preventDefault();
  }, { signal });
  return () => ending.abort();
}
