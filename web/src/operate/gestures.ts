// What pointer, wheel and keys do to a view: turning around the target (orbit), or turning the head and going (fly, walk).

import { type View, moved, nearer, turned } from "./orbit";
import { type Going, type Mode, gone, looked, standing } from "./ways";

type Change = (view: View) => View;
type Place = readonly [number, number];

export type Given = {
  readonly mode: () => Mode;
  readonly move: (change: Change) => void;
  readonly reset: () => void;
  /** A place of the picture was chosen: shares of width and height. */
  readonly choose: (place: Place) => void;
  /** The height of what one stands on. */
  readonly groundAt: (x: number, y: number, above: number) => number;
};

/** A pointer that moved less than this has clicked. */
const CLICK_PIXELS = 5;
const LOOK_RAD = 1.6;
/** Heads below which the ground is looked for when walking: higher steps are walls, or roofs. */
const STEP_M = 0.4;

const ORBIT_KEYS: Record<string, (view: View, shift: boolean) => View> = {
  ArrowLeft: (view, shift) => (shift ? moved(view, -0.05, 0) : turned(view, -0.06, 0)),
  ArrowRight: (view, shift) => (shift ? moved(view, 0.05, 0) : turned(view, 0.06, 0)),
  ArrowUp: (view, shift) => (shift ? moved(view, 0, 0.05) : turned(view, 0, 0.04)),
  ArrowDown: (view, shift) => (shift ? moved(view, 0, -0.05) : turned(view, 0, -0.04)),
  "+": (view) => nearer(view, 0.9),
  "=": (view) => nearer(view, 0.9),
  "-": (view) => nearer(view, 1 / 0.9),
  KeyA: (view) => moved(view, -0.05, 0),
  KeyD: (view) => moved(view, 0.05, 0),
  KeyW: (view) => moved(view, 0, 0.05),
  KeyS: (view) => moved(view, 0, -0.05),
};

/** Keys that are held down while going: to the right, ahead, upwards; and turning the head. */
const GOING: Record<string, readonly [right: number, ahead: number, up: number, turn: number]> = {
  KeyW: [0, 1, 0, 0], KeyS: [0, -1, 0, 0], KeyA: [-1, 0, 0, 0], KeyD: [1, 0, 0, 0],
  ArrowUp: [0, 1, 0, 0], ArrowDown: [0, -1, 0, 0], ArrowLeft: [0, 0, 0, 1], ArrowRight: [0, 0, 0, -1],
  KeyE: [0, 0, 1, 0], KeyQ: [0, 0, -1, 0],
};
const TURN_RAD_PER_SEC = 1.4;

/** Lets `stage` be looked around in; answers what undoes that. */
export function attach(stage: HTMLElement, given: Given): () => void {
  const ending = new AbortController();
  attachPointers(stage, given, ending.signal);
  const stopGoing = attachKeys(stage, given, ending.signal);
  return () => {
    ending.abort();
    stopGoing();
  };
}

function attachPointers(stage: HTMLElement, { mode, move, choose, groundAt }: Given, signal: AbortSignal): void {
  // One pointer turns (with shift or another button it moves), two move and pinch.
  const pointers = new Map<number, Place>();
  let travelled = 0;
  stage.addEventListener("pointerdown", (event) => {
    if (event.target instanceof Element && event.target.closest("button, [data-own]")) return;
    stage.setPointerCapture(event.pointerId);
    if (pointers.size === 0) travelled = event.button === 0 ? 0 : Infinity;
    else travelled = Infinity;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }, { signal });
  stage.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const now: Place = [event.clientX, event.clientY];
    travelled += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (travelled <= CLICK_PIXELS) return;
    pointers.set(event.pointerId, now);
    const [dx, dy] = [(now[0] - before[0]) / stage.clientHeight, (now[1] - before[1]) / stage.clientHeight];
    if (other) {
      const apart = (place: Place) => Math.max(10, Math.hypot(place[0] - other[0], place[1] - other[1]));
      move((view) => zoomed(moved(view, -dx / 2, dy / 2), apart(before) / apart(now), mode(), groundAt));
    } else if (event.shiftKey || event.buttons > 1) {
      move((view) => moved(view, -dx, dy));
    } else {
      move((view) => (mode() === "orbit" ? turned(view, -dx * 3, dy * 3) : looked(view, dx * LOOK_RAD, dy * LOOK_RAD)));
    }
  }, { signal });
  stage.addEventListener("pointerup", (event) => {
    if (!pointers.delete(event.pointerId) || travelled > CLICK_PIXELS) return;
    const box = stage.getBoundingClientRect();
    choose([(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height]);
  }, { signal });
  stage.addEventListener("pointercancel", (event) => pointers.delete(event.pointerId), { signal });
  stage.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
  stage.addEventListener("wheel", (event) => {
    if (event.target instanceof Element && event.target.closest("[data-own]")) return;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30);
    move((view) => zoomed(view, Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015), mode(), groundAt));
  }, { signal, passive: false });
}

/** Comes closer; who walks or flies goes ahead instead. */
function zoomed(view: View, factor: number, mode: Mode, groundAt: Given["groundAt"]): View {
  if (mode === "orbit") return nearer(view, factor);
  return went(view, mode, { right: 0, ahead: -Math.log(factor) * 2, up: 0, isFast: false }, 1, groundAt);
}

function went(view: View, mode: Mode, going: Going, seconds: number, groundAt: Given["groundAt"]): View {
  const ground = groundAt(view.eye[0], view.eye[1], view.eye[2]);
  const next = gone(view, mode, going, seconds, ground);
  return mode === "walk" ? standing(next, groundAt(next.eye[0], next.eye[1], next.eye[2] - STEP_M)) : next;
}

function attachKeys(stage: HTMLElement, { mode, move, reset, choose, groundAt }: Given, signal: AbortSignal): () => void {
  const held = new Set<string>();
  let isFast = false;
  let frame = 0;
  let before = 0;
  const go = (now: number) => {
    const seconds = Math.min((now - before) / 1e3, 0.2);
    before = now;
    const sum = [...held].map((code) => GOING[code] ?? [0, 0, 0, 0]).reduce<number[]>((all, one) => all.map((part, i) => part + (one[i] ?? 0)), [0, 0, 0, 0]);
    const [right = 0, ahead = 0, up = 0, turn = 0] = sum;
    move((view) => went(looked(view, turn * TURN_RAD_PER_SEC * seconds, 0), mode(), { right, ahead, up, isFast }, seconds, groundAt));
    frame = held.size > 0 ? requestAnimationFrame(go) : 0;
  };
  const hold = (code: string) => {
    held.add(code);
    if (frame !== 0) return;
    before = performance.now();
    frame = requestAnimationFrame(go);
  };
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target !== stage) return;
    isFast = event.shiftKey;
    const key = ORBIT_KEYS[event.key] ?? ORBIT_KEYS[event.code];
    if (event.key === "0") reset();
    else if (event.key === "Enter") choose([0.5, 0.5]);
    else if (mode() !== "orbit" && GOING[event.code]) hold(event.code);
    else if (mode() === "orbit" && key) move((view) => key(view, event.shiftKey));
    else return;
    event.preventDefault();
    event.stopPropagation();
  }, { signal });
  addEventListener("keyup", (event) => {
    held.delete(event.code);
    isFast = event.shiftKey;
  }, { signal });
  stage.addEventListener("blur", () => held.clear(), { signal });
  return () => cancelAnimationFrame(frame);
}
