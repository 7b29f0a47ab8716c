// Drawing by pointer and by keys: what the machine of `tools/drawing.ts` is fed with, and what becomes of its end.

import { signal } from "@preact/signals";
import { say } from "../../strings";
import type { Corner } from "../plan/frame";
import type { Drag } from "../plan/press";
import { addThing, middlePlace } from "./actions";
import { type Eye, onLevel, onUpright } from "./eye";
import { tidy } from "./operations";
import { distance, middle } from "./outline";
import { nearTo } from "./near";
import { meet, support } from "./pick";
import { snapHeight, snapPoint } from "./snapping";
import { choose, drawing, fileExtents, grid, guides, hidden, said, shown, tool } from "./state";
import { extentOf, things } from "./things";
import { type Drawing, type Drawn, back, begin, close, outlineOf, pointTo, setCorner, withHeight } from "./tools/drawing";
import { made } from "./tools/made";
import { sizes } from "./tools/sizes";

const TWICE_MILLIS = 400;
const TWICE_PX = 8;
const CLOSE_PX = 12;
const LOWEST_M = 0.1;
/** What is placed by keys without a pointer, metres across. */
const PLACED_M = 4;

/** Heights and thickness that were used last: the next of its kind is likely to be alike. */
export const usual = signal({ box: 3, cylinder: 3, wall: 2.5, footprint: 6, thickness: 0.2 });

let lastClick: { at: Corner; millis: number } | null = null;

const given = (of: Drawn) => ({ height: usual.value[of], thickness: usual.value.thickness });

function drawn(): Drawn {
  return tool.value === "select" ? "box" : tool.value;
}

function settled(next: Drawing): void {
  drawing.value = next;
  if (next.fault !== null) said.value = say(`geometry.draw.${next.fault}`);
  else said.value = next.stage === "height" ? "" : sizes(next);
  if (next.stage === "height") guides.value = { lines: [], height: 0 };
}

/** Where drawing begins: on what is beneath the pointer, or before the foot of its wall. */
function start(eye: Eye, at: Corner, event: PointerEvent): { at: Corner; base: number; yaw: number } | null {
  const ray = eye.ray(at);
  const among = { except: hidden.value, files: fileExtents.value };
  const met = meet(shown.value, ray, among);
  const level: Corner | null = met ? [met.at[0] - ray.along[0] * 1e-3, met.at[1] - ray.along[1] * 1e-3] : onLevel(ray, 0);
  if (!level) return null;
  const base = event.altKey ? 0 : support(shown.value, level, among).height;
  const onBase = (met && Math.abs(met.at[2] - base) < 0.01 ? level : onLevel(ray, base)) ?? level;
  const snapped = snapPoint(onBase, nearTo(eye, [...onBase, base], event, []));
  const edge = snapped.guides.find(({ kind }) => kind === "edge")?.line;
  const along = edge ? (Math.atan2(edge[1][1] - edge[0][1], edge[1][0] - edge[0][0]) * 180) / Math.PI : 0;
  return { at: [tidy(snapped.at[0]), tidy(snapped.at[1])], base, yaw: ((along % 90) + 90) % 90 };
}

/** Where the next corner would be. */
function next(eye: Eye, of: Drawing, at: Corner, event: PointerEvent): Corner | null {
  const level = onLevel(eye.ray(at), of.base);
  if (!level) return null;
  const near = nearTo(eye, [...level, of.base], event, []);
  const isLine = of.tool === "wall" || of.tool === "footprint";
  const last = of.corners.at(-1);
  const from = isLine && last && !event.altKey ? { last, before: of.corners.at(-2) } : undefined;
  const snapped = snapPoint(level, near, from);
  guides.value = { lines: snapped.guides, height: of.base };
  return [tidy(snapped.at[0]), tidy(snapped.at[1])];
}

function heightAt(eye: Eye, of: Drawing, at: Corner, event: PointerEvent): number | null {
  if (eye.isLevel) return null;
  const height = onUpright(eye.ray(at), middle(outlineOf(of)));
  if (height === null) return null;
  const others = things(shown.value).map((one) => extentOf(one, fileExtents.value).high);
  const near = nearTo(eye, [...of.pointer, of.base], event, []);
  const snapped = event.altKey ? height : snapHeight(height, others, { reach: near.reach, grid: grid.value });
  return Math.max(tidy(snapped - of.base), LOWEST_M);
}

export function hover(eye: Eye, at: Corner, event: PointerEvent): void {
  const of = drawing.value;
  if (!of) {
    const begun = start(eye, at, event);
    if (begun) guides.value = { lines: snapGuides(eye, begun, event), height: begun.base };
    return;
  }
  if (of.stage === "height") {
    const height = heightAt(eye, of, at, event);
    if (height !== null) drawing.value = withHeight(of, height);
    return;
  }
  const to = next(eye, of, at, event);
  if (to) drawing.value = pointTo(of, to);
}

function snapGuides(eye: Eye, { at, base }: { at: Corner; base: number }, event: PointerEvent) {
  return snapPoint(at, nearTo(eye, [...at, base], event, [])).guides;
}

/** A press of a drawing tool: it begins, or sets the next corner when it is let go. */
export function press(eye: () => Eye, at: Corner, event: PointerEvent): Drag | null {
  const before = drawing.value;
  if (before?.stage === "height") return { move: () => {}, end: (_at, _event, isClick) => isClick && finish(), cancel: () => {} };
  const begun = before ? null : start(eye(), at, event);
  if (!before && !begun) return null;
  if (begun) settled(begin(drawn(), begun.at, begun.base, { ...given(drawn()), yaw: begun.yaw }));
  return {
    move: (to, moved) => hover(eye(), to, moved),
    end: (to, ended, isClick) => released(eye(), to, ended, isClick, begun !== null),
    cancel: () => {
      drawing.value = before;
    },
  };
}

function released(eye: Eye, at: Corner, event: PointerEvent, isClick: boolean, isFirst: boolean): void {
  const of = drawing.value;
  // The first click only begins.
  if (!of || (isFirst && isClick)) {
    lastClick = null;
    return;
  }
  const isTwice = lastClick !== null && event.timeStamp - lastClick.millis < TWICE_MILLIS && distance(lastClick.at, at) < TWICE_PX;
  lastClick = { at, millis: event.timeStamp };
  if (isTwice && (of.tool === "wall" || of.tool === "footprint")) {
    settled(close(of));
    return;
  }
  const to = next(eye, of, at, event);
  if (to) settled(setCorner(of, to, CLOSE_PX * eye.metresPerPx([...to, of.base])));
}

/** Enter: ends the outline, then the whole; with nothing begun, places one in the middle of the map. */
export function enter(): void {
  const of = drawing.value;
  if (tool.value === "select") return;
  if (!of) {
    const { at, base } = middlePlace();
    const kind = drawn();
    const corners: Corner[] = kind === "footprint"
      ? [[at[0], at[1]], [at[0] + PLACED_M, at[1]], [at[0] + PLACED_M, at[1] + PLACED_M], [at[0], at[1] + PLACED_M]]
      : [at, kind === "box" ? [at[0] + PLACED_M, at[1] + PLACED_M] : [at[0] + PLACED_M / (kind === "cylinder" ? 4 : 1), at[1]]];
    settled(close(corners.slice(1).reduce((so, corner) => setCorner(so, corner), begin(kind, corners[0] ?? at, base, given(kind)))));
  } else if (of.stage === "outline") settled(close(of));
  else finish();
}

export function setHeight(height: number): void {
  if (drawing.value) drawing.value = withHeight(drawing.value, height);
}

export function setThickness(thickness: number): void {
  usual.value = { ...usual.value, thickness };
  if (drawing.value) drawing.value = { ...drawing.value, thickness };
}

/** Ends drawing with a thing, which is chosen; the tool is put down. */
export function finish(): void {
  const of = drawing.value;
  if (of?.stage !== "height") return;
  usual.value = { ...usual.value, [of.tool]: of.height };
  if (!addThing(of.tool, (id) => made(of, id))) return;
  put("select");
}

/** Escape and Backspace: one step back, then the tool is put down. */
export function stepBack(isAll = false): void {
  const of = drawing.value;
  const before = of && !isAll ? back(of) : null;
  guides.value = { lines: [], height: 0 };
  if (before) drawing.value = before;
  else if (of) drawing.value = null;
  else put("select");
}

/** Takes up a tool. */
export function put(next: typeof tool.value): void {
  drawing.value = null;
  guides.value = { lines: [], height: 0 };
  tool.value = next;
  if (next === "select") return;
  said.value = "";
  choose([]);
}
