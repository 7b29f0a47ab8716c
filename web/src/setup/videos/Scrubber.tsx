// A file's length with the part that is played: two ends, and the place that is looked at; by pointer and keys.

import { useRef } from "preact/hooks";
import { say } from "../../strings";
import { settle } from "../draft";

/** Seconds as 1:02:03.45. */
export function timecode(secs: number): string {
  const whole = Math.round(secs * 100) / 100;
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  const rest = (whole % 60).toFixed(2).padStart(5, "0");
  return hours > 0 ? `${hours}:${String(minutes).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}

type Handle = {
  kind: "at" | "from" | "until";
  value: number;
  low: number;
  high: number;
  length: number;
  frameSecs: number;
  isDisabled: boolean;
  onMove: (secs: number) => void;
};

function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}

function HandleOf({ kind, value, low, high, length, frameSecs, isDisabled, onMove }: Handle) {
  const move = (secs: number) => onMove(Math.round(clamp(secs, low, high) * 1e3) / 1e3);
  const onKeyDown = (event: KeyboardEvent) => {
    const step = event.shiftKey ? 1 : frameSecs;
    const to: Record<string, number> = {
      ArrowLeft: value - step, ArrowDown: value - step, ArrowRight: value + step, ArrowUp: value + step,
      PageDown: value - length / 20, PageUp: value + length / 20, Home: low, End: high,
    };
    const next = to[event.key];
    if (next === undefined || isDisabled) return;
    event.preventDefault();
    move(next);
  };
  return (
    <div role="slider" tabIndex={isDisabled ? -1 : 0} class={`handle is-${kind}`} style={{ left: `${(value / length) * 100}%` }}
      aria-label={say(`videos.part.${kind}`)} aria-valuemin={low} aria-valuemax={high} aria-valuenow={value} aria-valuetext={timecode(value)}
      aria-disabled={isDisabled} onKeyDown={onKeyDown}
      onPointerDown={(event) => {
        if (isDisabled) return;
        event.stopPropagation();
        event.currentTarget.setPointerCapture(event.pointerId);
      }}
      onPointerMove={(event) => {
        const track = event.currentTarget.parentElement?.getBoundingClientRect();
        if (track && event.currentTarget.hasPointerCapture(event.pointerId)) move(((event.clientX - track.left) / track.width) * length);
      }}
      onPointerUp={settle} />
  );
}

export function Scrubber({ length, from, until, at, rateHz, isDisabled, onAt, onPart }: {
  length: number;
  from: number;
  until: number;
  at: number;
  rateHz: number | null;
  isDisabled: boolean;
  onAt: (secs: number) => void;
  onPart: (from: number, until: number) => void;
}) {
  const track = useRef<HTMLDivElement>(null);
  const frameSecs = 1 / (rateHz ?? 25);
  const common = { length, frameSecs };
  const look = (event: PointerEvent) => {
    const box = track.current?.getBoundingClientRect();
    if (box) onAt(Math.round(clamp((event.clientX - box.left) / box.width, 0, 1) * length * 1e3) / 1e3);
  };
  return (
    <div class="scrubber">
      <div class="track" ref={track}
        onPointerDown={(event) => {
          event.currentTarget.setPointerCapture(event.pointerId);
          look(event);
        }}
        onPointerMove={(event) => {
          if (event.currentTarget.hasPointerCapture(event.pointerId)) look(event);
        }}>
        <div class="played" style={{ left: `${(from / length) * 100}%`, right: `${100 - (until / length) * 100}%` }} />
        <HandleOf {...common} kind="from" value={from} low={0} high={Math.max(0, until - frameSecs)} isDisabled={isDisabled} onMove={(secs) => onPart(secs, until)} />
        <HandleOf {...common} kind="until" value={until} low={Math.min(length, from + frameSecs)} high={length} isDisabled={isDisabled} onMove={(secs) => onPart(from, secs)} />
        <HandleOf {...common} kind="at" value={clamp(at, 0, length)} low={0} high={length} isDisabled={false} onMove={onAt} />
      </div>
      <p class="track-ends quiet"><span>{timecode(0)}</span><span>{timecode(at)}</span><span>{timecode(length)}</span></p>
    </div>
  );
}
