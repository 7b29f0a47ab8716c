// The timeline: what there is of a scene's time, camera by camera, where in it the viewer stands, and how to go elsewhere.

import { effect } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { dependOn } from "../depend";
import { say } from "../strings";
import { tick } from "../tick";
import { clock, duration } from "../units";
import * as clockwork from "./clockwork";
import { Preview } from "./Preview";
import { RangeHandles } from "./RangeHandles";
import * as state from "./state";
import { draw, listen } from "./strip";
import { TimeEntry } from "./TimeEntry";
import { zoomed } from "./timescale";

/** Signs that every machine has, which fonts do not. */
const SIGNS = {
  back: "M3 2h2v12H3zM14 2v12L6 8z",
  reverse: "M13 2v12L3 8z",
  pause: "M3 2h4v12H3zM9 2h4v12H9z",
  play: "M3 2v12l10-6z",
  forward: "M11 2h2v12h-2zM2 2v12l8-6z",
  out: "M3 7h10v2H3z",
  in: "M3 7h4V3h2v4h4v2H9v4H7V9H3z",
} as const;

function Icon({ sign, label, isOn, isDisabled = false, then }: { sign: keyof typeof SIGNS; label: string; isOn?: boolean; isDisabled?: boolean; then: () => void }) {
  return (
    <button type="button" class={`icon ${isOn ? "is-on" : ""}`} disabled={isDisabled} aria-label={label} title={label} aria-pressed={isOn} onClick={then}>
      <svg viewBox="0 0 16 16" aria-hidden="true"><path d={SIGNS[sign]} /></svg>
    </button>
  );
}

function Transport({ isLive, isClosed }: { isLive: boolean; isClosed: boolean }) {
  const playing = clockwork.playing.value;
  return (
    <div class="transport" role="group" aria-label={say("time.controls")}>
      <Icon sign="back" label={say("time.back")} isDisabled={isClosed} then={() => void clockwork.step(-1)} />
      <Icon sign="reverse" label={say("time.reverse")} isOn={playing === -1} isDisabled={isClosed} then={() => clockwork.togglePlay(-1)} />
      <Icon sign="pause" label={say("time.pause")} isDisabled={isClosed} isOn={!isLive && playing === null} then={clockwork.pause} />
      <Icon sign="play" label={say("time.play")} isOn={playing === 1} isDisabled={isLive} then={() => clockwork.togglePlay(1)} />
      <Icon sign="forward" label={say("time.forward")} isDisabled={isLive} then={() => void clockwork.step(1)} />
      <button type="button" class={isLive ? "is-on" : ""} onClick={clockwork.goLive} aria-pressed={isLive} title={say("time.live.title")}>{say("time.live")}</button>
      <label class="inline">
        <span class="hidden">{say("time.rate")}</span>
        <select value={clockwork.rate.value} title={say("time.rate")} onChange={(event) => (clockwork.rate.value = clockwork.RATES.find((known) => known === event.currentTarget.value) ?? "1")}>
          {clockwork.RATES.map((value) => <option key={value} value={value}>{value} ×</option>)}
        </select>
      </label>
    </div>
  );
}

export function Timeline() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [width, setWidth] = useState(0);
  useEffect(() => {
    const element = canvas.current;
    if (!element) return undefined;
    const sizes = new ResizeObserver(() => setWidth(element.clientWidth));
    sizes.observe(element);
    let frame = 0;
    const stopDrawing = effect(() => {
      dependOn(clockwork.stretch, clockwork.told, clockwork.range, state.at, state.shown, state.openedCamera, tick);
      cancelAnimationFrame(frame);
      frame = requestAnimationFrame(() => draw(element));
    });
    const stops = [clockwork.attend(), listen(element), stopDrawing];
    return () => {
      sizes.disconnect();
      cancelAnimationFrame(frame);
      for (const stop of stops) stop();
    };
  }, []);
  const isLive = state.at.value === null;
  const isClosed = clockwork.closed.value !== null && clockwork.closed.value === state.scene.value?.id;
  const shown = clockwork.shownTime();
  const { from, to } = clockwork.stretch.value;
  const zoom = (factor: number) => (clockwork.stretch.value = zoomed(clockwork.stretch.value, shown, factor));
  return (
    <section class="time" aria-label={say("time.title")}>
      <div class="time-bar">
        <Transport isLive={isLive} isClosed={isClosed} />
        <TimeEntry isLive={isLive} />
        <span class="pair">
          <Icon sign="out" label={say("time.out")} then={() => zoom(1 / 0.6)} />
          <span class="quiet">{duration((to - from) / 1e3)}</span>
          <Icon sign="in" label={say("time.in")} then={() => zoom(0.6)} />
        </span>
      </div>
      <div class="strip-box">
        <canvas ref={canvas} class="strip" role="slider" tabIndex={0} aria-label={say("time.strip")}
          aria-valuemin={Math.round(from)} aria-valuemax={Math.round(to)} aria-valuenow={Math.round(shown)}
          aria-valuetext={isLive ? say("time.now") : clock(shown, true)} data-rows={clockwork.rows().length} />
        <RangeHandles width={width} />
        <Preview width={width} />
      </div>
      <p class="quiet" role="status">{isClosed ? say("time.none") : clockwork.notice.value}</p>
    </section>
  );
}
