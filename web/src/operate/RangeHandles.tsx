// The two ends of the part of time that is exported, over the timeline: dragged, or moved by keys.

import { useRef } from "preact/hooks";
import { say } from "../strings";
import { clock } from "../units";
import * as clockwork from "./clockwork";
import { gutter } from "./strip";
import type { Stretch } from "./timescale";

const LEAST_MILLIS = 100;
const KEYS: Record<string, number> = { ArrowLeft: -1e3, ArrowRight: 1e3, PageDown: -60e3, PageUp: 60e3 };

/** The range with one end elsewhere, never turned around. */
function withEnd(range: Stretch, end: keyof Stretch, millis: number): Stretch {
  return end === "from" ? { ...range, from: Math.min(millis, range.to - LEAST_MILLIS) } : { ...range, to: Math.max(millis, range.from + LEAST_MILLIS) };
}

function Handle({ end, width, range }: { end: keyof Stretch; width: number; range: Stretch }) {
  const held = useRef(false);
  const { from, to } = clockwork.stretch.value;
  const left = gutter(width);
  const x = left + ((range[end] - from) / (to - from)) * (width - left);
  const set = (millis: number) => (clockwork.range.value = withEnd(range, end, millis));
  if (x < left - 1 || x > width + 1) return null;
  return (
    <button type="button" class={`handle is-${end}`} role="slider" style={{ left: `${x}px` }} aria-label={say(`export.${end}`)} title={`${say(`export.${end}`)}: ${clock(range[end], true)}`}
      aria-valuemin={Math.round(from)} aria-valuemax={Math.round(to)} aria-valuenow={Math.round(range[end])} aria-valuetext={clock(range[end], true)}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        held.current = true;
      }}
      onPointerMove={(event) => {
        const box = event.currentTarget.parentElement?.getBoundingClientRect();
        if (!held.current || !box) return;
        set(from + ((event.clientX - box.left - left) / (width - left)) * (to - from));
      }}
      onPointerUp={() => (held.current = false)}
      onPointerCancel={() => (held.current = false)}
      onKeyDown={(event) => {
        const by = KEYS[event.key];
        if (by === undefined) return;
        event.preventDefault();
        event.stopPropagation();
        set(range[end] + (event.shiftKey ? by / 10 : by));
      }} />
  );
}

export function RangeHandles({ width }: { width: number }) {
  const range = clockwork.range.value;
  if (!range || width === 0) return null;
  return <><Handle end="from" width={width} range={range} /><Handle end="to" width={width} range={range} /></>;
}
