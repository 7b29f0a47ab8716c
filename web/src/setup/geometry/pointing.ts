// What pointers do over map and view: they choose, grasp handles, move what is chosen, and draw. Both give an eye; all else is alike.

import type { Point } from "../../operate/orbit";
import { say } from "../../strings";
import { type SceneDocument, isReadOnly } from "../draft";
import type { Corner } from "../plan/frame";
import type { Drag, Handlers } from "../plan/press";
import { commitPreview } from "./actions";
import { checkThing } from "./checks";
import * as draws from "./drawings";
import { type Eye, onLevel, onUpright } from "./eye";
import { type Handle, handlesOf, turnTo } from "./handles";
import { extentOfAll, move, tidy, turn } from "./operations";
import { enlarged, nearTo } from "./near";
import { meet, support } from "./pick";
import { snapHeight, snapMove, snapPoint, snapTurn, turnsOf } from "./snapping";
import { chosen, choose, fileExtents, grasp, guides, hidden, preview, said, shown, toggle, tool } from "./state";
import { extentOf, thing, things, yawOf } from "./things";

const HANDLE_PX = 13;
const TOUCH_PX = 24;
const ROOM_PX = 16;
/** How far towards the middle of a thing its handles reach, share of the way. */
const INNER_SHARE = 0.45;
/** How far beside a thing stands what turns it. */
const GAP_PX = 30;
/** A thing within this of what is below stands on it. */
const STANDS_M = 0.02;

export function gapOf(eye: Eye, document: SceneDocument, of: readonly string[]): number {
  const extent = extentOfAll(document, of, fileExtents.value);
  return extent ? GAP_PX * enlarged() * eye.metresPerPx([...extent.middle, extent.high]) : 0;
}

/** What can be grasped now. Seen from straight above, heights cannot. */
export function handlesNow(eye: Eye): Handle[] {
  if (tool.value !== "select" || isReadOnly.value) return [];
  const all = handlesOf(shown.value, chosen.value, gapOf(eye, shown.value, chosen.value), fileExtents.value);
  const roomy = all.filter((handle) => handle.kind !== "between" || isRoomy(eye, handle, all));
  return eye.isLevel ? roomy.filter(({ way }) => way === "level") : roomy;
}

/** What makes new corners is left out where it would lie on the corners that are there. */
function isRoomy(eye: Eye, between: Handle, all: readonly Handle[]): boolean {
  const place = eye.place(between.at);
  return place !== null && all.every(({ kind, at }) => {
    const corner = kind === "vertex" ? eye.place(at) : null;
    return !corner || Math.hypot(corner[0] - place[0], corner[1] - place[1]) > ROOM_PX * enlarged();
  });
}

function handleAt(eye: Eye, at: Corner, event: PointerEvent): Handle | null {
  let found: Handle | null = null;
  let least = Infinity;
  const most = (event.pointerType === "touch" ? TOUCH_PX : HANDLE_PX) * enlarged();
  const extent = extentOfAll(shown.value, chosen.value, fileExtents.value);
  const middle = extent && eye.place([...extent.middle, extent.high]);
  for (const handle of handlesNow(eye)) {
    const place = eye.place(handle.at);
    const apart = place ? Math.hypot(place[0] - at[0], place[1] - at[1]) : Infinity;
    // Of something small, what lies within is for moving it.
    const isWithin = place && middle && handle.way === "level" && handle.kind !== "turn";
    const reach = isWithin ? Math.min(most, Math.hypot(place[0] - middle[0], place[1] - middle[1]) * INNER_SHARE) : most;
    if (apart > reach) continue;
    // What makes a new corner gives way to the corners.
    if (apart + (handle.kind === "between" ? 2 : 0) < least) [found, least] = [handle, apart];
  }
  return found;
}

function heightsBut(document: SceneDocument, except: readonly string[]): number[] {
  return [0, ...things(document).filter(({ of }) => !except.includes(of.id)).flatMap((one) => {
    const { low, high } = extentOf(one, fileExtents.value);
    return [low, high];
  })];
}

/** Where a handle is dragged to, snapped. */
function handleTo(eye: Eye, start: SceneDocument, handle: Handle, at: Corner, event: PointerEvent): Point | null {
  const ray = eye.ray(at);
  const [x, y, z] = handle.at;
  if (handle.way === "upright") {
    const height = onUpright(ray, [x, y]);
    if (height === null) return null;
    const off = handle.kind === "lift" ? gapOf(eye, start, chosen.value) : 0;
    if (event.altKey) return [x, y, height];
    return [x, y, snapHeight(height - off, heightsBut(start, chosen.value), nearTo(eye, handle.at, event, chosen.value)) + off];
  }
  const level = onLevel(ray, z);
  if (!level) return null;
  if (handle.kind === "turn") return [...level, z];
  const near = nearTo(eye, handle.at, event, chosen.value);
  const snapped = snapPoint(level, near, cornerBefore(start, handle));
  guides.value = { lines: snapped.guides, height: z };
  return [...snapped.at, z];
}

/** The corner before a footprint's, to which it may be square. */
function cornerBefore(start: SceneDocument, { key, kind }: Handle): { last: Corner; before?: Corner } | undefined {
  const one = thing(start, chosen.value[0] ?? "");
  if (kind !== "vertex" || one?.list !== "footprints") return undefined;
  const { polygon } = one.of;
  const i = Number(key.slice("vertex".length));
  const corner = (j: number): Corner => {
    const [x = 0, y = 0] = polygon[(j + polygon.length) % polygon.length] ?? [];
    return [x, y];
  };
  return { last: corner(i - 1), before: corner(i - 2) };
}

/** Turns by a handle come to lie square to others. */
function turnedBy(start: SceneDocument, handle: Handle, to: Point, event: PointerEvent): SceneDocument {
  const of = chosen.value;
  const extent = extentOfAll(start, of, fileExtents.value);
  if (!extent || event.altKey) return handle.apply(start, to);
  const only = of.length === 1 ? thing(start, of[0] ?? "") : null;
  const before = (only && yawOf(only)) ?? 0;
  const wanted = turnTo(extent.middle, [to[0], to[1]]);
  const next = snapTurn(wanted, turnsOf(start, new Set([...of, ...hidden.value])));
  said.value = say("geometry.turned", { degrees: tidy(next).toFixed(1) });
  return turn(start, of, extent.middle, next - before);
}

/** What is wrong with the chosen things in a document. */
function faultOf(document: SceneDocument): string | null {
  const one = chosen.value.map((id) => thing(document, id)).find((found) => found && checkThing(found).length > 0);
  const [check] = one ? checkThing(one) : [];
  return check ? say(`geometry.check.${check.key}`, check.values) : null;
}

function finish(label: string): void {
  const fault = preview.value && faultOf(preview.value);
  guides.value = { lines: [], height: 0 };
  if (fault === null) commitPreview(label);
  else [preview.value, said.value] = [null, say("geometry.refused", { why: fault })];
}

/** Drags are counted, so that one that Escape ended stays ended while the pointer is still down. */
let latest = 0;

function begun(): () => boolean {
  latest += 1;
  const own = latest;
  return () => own === latest;
}

export function cancelDrag(): void {
  latest += 1;
  preview.value = null;
  guides.value = { lines: [], height: 0 };
}

function dragHandle(eye: () => Eye, handle: Handle): Drag {
  const start = shown.value;
  const isOn = begun();
  return {
    move: (at, event) => {
      if (!isOn()) return;
      const to = handleTo(eye(), start, handle, at, event);
      if (!to) return;
      preview.value = handle.kind === "turn" ? turnedBy(start, handle, to, event) : handle.apply(start, to);
      const fault = faultOf(preview.value);
      if (fault !== null) said.value = fault;
    },
    end: (_at, _event, isClick) => {
      if (isClick) cancelDrag();
      else if (isOn()) finish(say(handle.kind === "turn" ? "geometry.step.turn" : "geometry.step.change", { what: chosen.value.join(", ") }));
    },
    cancel: cancelDrag,
  };
}

function dragThings(eye: () => Eye, from: Point, hit: string): Drag {
  const start = shown.value;
  const of = chosen.value;
  const except = new Set(of);
  const extents = of.map((id) => ({ id, one: thing(start, id) })).flatMap(({ id, one }) => (one ? [{ id, extent: extentOf(one, fileExtents.value) }] : []));
  const among = { except, files: fileExtents.value };
  const standing = extents.filter(({ extent }) => Math.abs(extent.low - support(start, extent.middle, among).height) < STANDS_M);
  const whole = extentOfAll(start, of, fileExtents.value);
  const isOn = begun();
  return {
    move: (at, event) => {
      if (!isOn()) return;
      const to = onLevel(eye().ray(at), from[2]);
      if (!to || !whole) return;
      const near = nearTo(eye(), from, event, of);
      const snapped = snapMove(whole.outline, [to[0] - from[0], to[1] - from[1]], near);
      guides.value = { lines: snapped.guides, height: whole.low };
      let next = move(start, of, [tidy(snapped.by[0]), tidy(snapped.by[1]), 0]);
      if (!event.altKey) for (const { id, extent } of standing) next = stood(next, start, id, extent.middle, snapped.by, among);
      preview.value = next;
    },
    end: (_at, event, isClick) => {
      if (!isClick) {
        if (isOn()) finish(say("geometry.step.move", { what: of.join(", ") }));
        return;
      }
      cancelDrag();
      if (event.shiftKey) toggle(hit);
      else choose([hit]);
    },
    cancel: cancelDrag,
  };
}

/** What stood on something stands, where it is moved to, on what is there. */
function stood(document: SceneDocument, start: SceneDocument, id: string, middle: Corner, by: Corner, among: Parameters<typeof support>[2]): SceneDocument {
  const before = support(start, middle, among).height;
  const { height, id: on } = support(start, [middle[0] + by[0], middle[1] + by[1]], among);
  if (height !== before && on !== null) said.value = say("geometry.standsOn", { what: on, height: height.toFixed(2) });
  return move(document, [id], [0, 0, tidy(height - before)]);
}

/** What is beneath a pointer. */
function metAt(eye: Eye, at: Corner) {
  return meet(shown.value, eye.ray(at), { except: hidden.value, files: fileExtents.value });
}

function graspAt(eye: Eye, at: Corner, event: PointerEvent): typeof grasp.value {
  if (handleAt(eye, at, event)) return "grab";
  const id = metAt(eye, at)?.id ?? null;
  if (id === null) return "default";
  return chosen.value.includes(id) ? "move" : "pointer";
}

/** What pointers do over a picture that this eye sees. */
export function pointing(eye: () => Eye): Omit<Handlers, "travel" | "zoom"> {
  return {
    press: (at, event) => {
      if (isReadOnly.value) return null;
      if (tool.value !== "select") return draws.press(eye, at, event);
      const handle = handleAt(eye(), at, event);
      if (handle) return dragHandle(eye, handle);
      const met = metAt(eye(), at);
      return met?.id && chosen.value.includes(met.id) ? dragThings(eye, met.at, met.id) : null;
    },
    click: (at, event) => {
      if (tool.value !== "select") return;
      const id = metAt(eye(), at)?.id ?? null;
      if (id === null) {
        if (!event.shiftKey) choose([]);
      } else if (event.shiftKey) toggle(id);
      else choose([id]);
    },
    hover: (at, event) => {
      if (tool.value === "select") grasp.value = graspAt(eye(), at, event);
      else draws.hover(eye(), at, event);
    },
    leave: () => {
      guides.value = { lines: [], height: 0 };
      grasp.value = "default";
    },
  };
}
