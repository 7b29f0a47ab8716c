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

function Icon({ text, label, isOn, isDisabled = false, then }: { text: string; label: string; isOn?: boolean; isDisabled?: boolean; then: () => void }) {
  return (
    <button type="button" class={isOn ? "is-on" : ""} disabled={isDisabled} aria-label={label} title={label} aria-pressed={isOn} onClick={then}>
      <span aria-hidden="true">{text}</span>
    </button>
  );
}

function Transport({ isLive, isClosed }: { isLive: boolean; isClosed: boolean }) {
  const playing = clockwork.playing.value;
  return (
    <div class="transport" role="group" aria-label={say("time.controls")}>
      <Icon text="⏮" label={say("time.back")} isDisabled={isClosed} then={() => void clockwork.step(-1)} />
      <Icon text="◀" label={say("time.reverse")} isOn={playing === -1} isDisabled={isClosed} then={() => clockwork.togglePlay(-1)} />
      <Icon text="⏸" label={say("time.pause")} isDisabled={isClosed} isOn={!isLive && playing === null} then={clockwork.pause} />
      <Icon text="▶" label={say("time.play")} isOn={playing === 1} isDisabled={isLive} then={() => clockwork.togglePlay(1)} />
      <Icon text="⏭" label={say("time.forward")} isDisabled={isLive} then={() => void clockwork.step(1)} />
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
          <Icon text="−" label={say("time.out")} then={() => zoom(1 / 0.6)} />
          <span class="quiet">{duration((to - from) / 1e3)}</span>
          <Icon text="+" label={say("time.in")} then={() => zoom(0.6)} />
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
