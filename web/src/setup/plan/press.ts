// Pointers over a map or a view: one presses and drags what is there, or else moves the picture; two move and pinch it; the wheel
// brings it nearer. Places are pixels from the element's upper left corner.

import type { Corner } from "./frame";

export type Drag = {
  readonly move: (at: Corner, event: PointerEvent) => void;
  /** `isClick`: the pointer hardly moved since it was pressed. */
  readonly end: (at: Corner, event: PointerEvent, isClick: boolean) => void;
  readonly cancel: () => void;
};

export type Handlers = {
  /** What a press of the first button begins; null where it moves the picture. */
  readonly press: (at: Corner, event: PointerEvent) => Drag | null;
  /** A click that neither dragged nor moved anything. */
  readonly click?: (at: Corner, event: PointerEvent) => void;
  readonly hover?: (at: Corner, event: PointerEvent) => void;
  readonly leave?: () => void;
  /** The picture is moved by pixels; `isOther`: with another button, Shift or two fingers. */
  readonly travel: (by: Corner, isOther: boolean) => void;
  readonly zoom: (factor: number, at: Corner) => void;
};

/** Pointers move so far before it is a drag. */
const CLICK_PX = 4;
const WHEEL_PX = 300;

/** Listens on `element` until what it answers is called. `now` tells the handlers as they are. */
export function attachPress(element: HTMLElement | SVGElement, now: () => Handlers): () => void {
  const ending = new AbortController();
  const { signal } = ending;
  const pointers = new Map<number, Corner>();
  let drag: Drag | null = null;
  let from: Corner = [0, 0];
  let hasMoved = false;
  const place = (event: MouseEvent): Corner => {
    const { left, top } = element.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  const listen = (name: "pointerdown" | "pointermove" | "pointerup" | "pointercancel" | "pointerleave", then: (event: PointerEvent) => void) =>
    element.addEventListener(name, (event) => then(event as PointerEvent), { signal });

  listen("pointerdown", (event) => {
    if (event.target instanceof Element && event.target.closest("button, input, select, a")) return;
    element.setPointerCapture(event.pointerId);
    const at = place(event);
    pointers.set(event.pointerId, at);
    if (pointers.size > 1) {
      drag?.cancel();
      drag = null;
      hasMoved = true;
      return;
    }
    [from, hasMoved] = [at, false];
    drag = event.button === 0 ? now().press(at, event) : null;
  });

  listen("pointermove", (event) => {
    const at = place(event);
    const before = pointers.get(event.pointerId);
    if (!before) {
      now().hover?.(at, event);
      return;
    }
    if (Math.hypot(at[0] - from[0], at[1] - from[1]) > CLICK_PX) hasMoved = true;
    pointers.set(event.pointerId, at);
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const by: Corner = [at[0] - before[0], at[1] - before[1]];
    if (other) {
      const apart = (one: Corner) => Math.max(10, Math.hypot(one[0] - other[0], one[1] - other[1]));
      now().travel([by[0] / 2, by[1] / 2], true);
      now().zoom(apart(at) / apart(before), [(at[0] + other[0]) / 2, (at[1] + other[1]) / 2]);
    } else if (drag) {
      drag.move(at, event);
    } else if (hasMoved) {
      now().travel(by, event.buttons > 1 || event.shiftKey);
    }
  });

  listen("pointerup", (event) => {
    if (!pointers.delete(event.pointerId)) return;
    const at = place(event);
    const ended = drag;
    drag = null;
    if (ended) ended.end(at, event, !hasMoved);
    else if (!hasMoved && event.button === 0) now().click?.(at, event);
  });
  listen("pointercancel", (event) => {
    pointers.delete(event.pointerId);
    drag?.cancel();
    drag = null;
  });
  listen("pointerleave", () => now().leave?.());
  element.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
  element.addEventListener("wheel", (given) => {
    const event = given as WheelEvent;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30);
    now().zoom(Math.exp(-Math.max(-WHEEL_PX, Math.min(WHEEL_PX, pixels)) * 0.0015), place(event));
  }, { signal, passive: false });
  return () => ending.abort();
}
