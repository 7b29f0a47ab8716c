// Pointers over the picture: a click places, a drag on something moves it, a drag elsewhere moves the picture (or draws), the wheel
// and two fingers zoom.

import type { Signal } from "@preact/signals";
import { type Frame, type Pane, panned, toPicture, toScreen, zoomed } from "./frame";
import type { Pixel } from "./pairs";

export type Grips<Grip> = {
  /** What can be taken hold of, and where it lies in the picture. */
  readonly all: () => readonly { readonly grip: Grip; readonly at: Pixel }[];
  readonly take: (grip: Grip) => void;
  readonly move: (grip: Grip, to: Pixel) => void;
  readonly drop: (grip: Grip) => void;
};

export type Wanted<Grip> = {
  readonly frame: Signal<Frame>;
  readonly pane: () => Pane | null;
  readonly grips: Grips<Grip>;
  readonly click: (at: Pixel) => void;
  readonly hover: (at: Pixel | null, isTouch: boolean) => void;
  /** Takes a drag that begins where there is nothing to take hold of, instead of moving the picture. */
  readonly draw: () => { readonly end: (from: Pixel, to: Pixel) => void; readonly begin: (from: Pixel) => void } | null;
};

const REACH_PX = { mouse: 11, touch: 24 } as const;
/** A finger or a hand trembles this far in a click. */
const TREMBLE_PX = 5;
const WHEEL_LOG = 0.0016;

type Doing<Grip> = { kind: "grip"; grip: Grip; by: Pixel; isMoved: boolean } | { kind: "pan" } | { kind: "draw"; from: Pixel } | { kind: "click" };

/** Follows the pointers of an element; answers what ends it. */
export function follow<Grip>(element: HTMLElement, wanted: Wanted<Grip>): () => void {
  const pointers = new Map<number, Pixel>();
  let doing: Doing<Grip> | null = null;
  let began: Pixel = [0, 0];
  const { frame, grips } = wanted;

  const screenOf = (event: PointerEvent | WheelEvent): Pixel => {
    const box = element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const isIn = ([x, y]: Pixel, [width, height]: Pixel) => x >= 0 && y >= 0 && x <= width && y <= height;
  const apart = (a: Pixel, b: Pixel) => Math.hypot(a[0] - b[0], a[1] - b[1]);

  const gripAt = (at: Pixel, pane: Pane, reach: number) =>
    grips.all()
      .map(({ grip, at: place }) => ({ grip, place, away: apart(at, toScreen(frame.value, pane, place)) }))
      .filter(({ away }) => away <= reach)
      .sort((a, b) => a.away - b.away)[0];

  const down = (event: PointerEvent) => {
    const pane = wanted.pane();
    if (!pane || (event.target as Element).closest("button")) return;
    const at = screenOf(event);
    pointers.set(event.pointerId, at);
    element.setPointerCapture(event.pointerId);
    if (pointers.size > 1) {
      doing = null;
      return;
    }
    began = at;
    if (event.button !== 0) {
      doing = { kind: "pan" };
      return;
    }
    const isTouch = event.pointerType === "touch";
    const near = gripAt(at, pane, isTouch ? REACH_PX.touch : REACH_PX.mouse);
    if (near) {
      const [x, y] = toScreen(frame.value, pane, near.place);
      doing = { kind: "grip", grip: near.grip, by: [x - at[0], y - at[1]], isMoved: false };
      grips.take(near.grip);
    } else doing = { kind: "click" };
    wanted.hover(toPicture(frame.value, pane, at), isTouch);
  };

  const drag = (at: Pixel, before: Pixel, pane: Pane) => {
    if (doing?.kind === "click" && apart(at, began) > TREMBLE_PX) {
      const from = toPicture(frame.value, pane, began);
      const drawing = wanted.draw();
      doing = drawing ? { kind: "draw", from } : { kind: "pan" };
      drawing?.begin(from);
    }
    if (doing?.kind === "pan") frame.value = panned(frame.value, pane, [at[0] - before[0], at[1] - before[1]]);
    if (doing?.kind === "grip" && (doing.isMoved || apart(at, began) > 1)) {
      doing.isMoved = true;
      grips.move(doing.grip, toPicture(frame.value, pane, [at[0] + doing.by[0], at[1] + doing.by[1]]));
    }
  };

  const move = (event: PointerEvent) => {
    const pane = wanted.pane();
    if (!pane) return;
    const at = screenOf(event);
    const before = pointers.get(event.pointerId);
    if (before && pointers.size === 2) pinch(event.pointerId, before, at, pane);
    else if (before) drag(at, before, pane);
    if (before) pointers.set(event.pointerId, at);
    const place = toPicture(frame.value, pane, at);
    wanted.hover(isIn(place, pane.picture) ? place : null, event.pointerType === "touch");
  };

  const pinch = (id: number, before: Pixel, at: Pixel, pane: Pane) => {
    const other = [...pointers].find(([key]) => key !== id)?.[1];
    if (!other) return;
    const middle = (of: Pixel): Pixel => [(of[0] + other[0]) / 2, (of[1] + other[1]) / 2];
    const factor = apart(at, other) / Math.max(apart(before, other), 1);
    const [from, to] = [middle(before), middle(at)];
    frame.value = panned(zoomed(frame.value, pane, factor, from), pane, [to[0] - from[0], to[1] - from[1]]);
  };

  const up = (event: PointerEvent) => {
    const pane = wanted.pane();
    const at = screenOf(event);
    if (!pointers.delete(event.pointerId) || !pane) return;
    const [did, place] = [doing, toPicture(frame.value, pane, at)];
    doing = null;
    if (event.type === "pointerup") {
      if (did?.kind === "click" && isIn(place, pane.picture)) wanted.click(place);
      if (did?.kind === "draw") wanted.draw()?.end(did.from, place);
    }
    if (did?.kind === "grip") grips.drop(did.grip);
    if (event.pointerType === "touch") wanted.hover(null, true);
  };

  const wheel = (event: WheelEvent) => {
    const pane = wanted.pane();
    if (!pane) return;
    event.preventDefault();
    frame.value = zoomed(frame.value, pane, Math.exp(-event.deltaY * WHEEL_LOG), screenOf(event));
  };
  const leave = (event: PointerEvent) => {
    if (!pointers.has(event.pointerId)) wanted.hover(null, false);
  };
  const menu = (event: Event) => event.preventDefault();

  element.addEventListener("pointerdown", down);
  element.addEventListener("pointermove", move);
  element.addEventListener("pointerup", up);
  element.addEventListener("pointercancel", up);
  element.addEventListener("pointerleave", leave);
  element.addEventListener("wheel", wheel, { passive: false });
  element.addEventListener("contextmenu", menu);
  return () => {
    element.removeEventListener("pointerdown", down);
    element.removeEventListener("pointermove", move);
    element.removeEventListener("pointerup", up);
    element.removeEventListener("pointercancel", up);
    element.removeEventListener("pointerleave", leave);
    element.removeEventListener("wheel", wheel);
    element.removeEventListener("contextmenu", menu);
  };
}
