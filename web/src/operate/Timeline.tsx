// The timeline: what there is of a scene's time, camera by camera, and where in it the viewer stands. Drawn on a canvas, since
// hours of activity are thousands of bars.

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Trouble, api, content } from "../ask";
import type { paths } from "../contract.gen";
import { dependOn } from "../depend";
import { say, sayWord } from "../strings";
import { tick } from "../tick";
import { clock, duration } from "../units";
import { about } from "./fused";
import * as state from "./state";
import { type Stretch, following, label, shifted, ticks, zoomed } from "./timescale";

type Answer = paths["/api/v1/scenes/{id}/timeline"]["get"]["responses"]["200"]["content"]["application/json"];
type Row = { camera: string; ranges: [number, number][]; activity: { at: number; share: number }[] };
type Told = { scene: string; stepMillis: number; rows: Row[]; events: { at: number; text: string }[] };

const ASK_MILLIS = 4_000;
const SOON_MILLIS = 200;
const MOST_BARS = 600;
const LEAST_STEP_SECS = 60;
/** A step of the keys and buttons: a frame of most cameras. */
const STEP_MILLIS = 100;
const RATES = ["0.25", "1", "4", "16"] as const;
/** Wheel and drag: what a pixel means. */
const ZOOM_PER_PIXEL = 0.002;
const CLICK_PIXELS = 4;
/** Where time begins, beside the cameras' names: a share of the width, and at most so many times the text's height. */
const GUTTER_SHARE = 0.28;
const GUTTER_LINES = 11;

const stretch = signal<Stretch>({ from: Date.now() - 120e3, to: Date.now() + 4e3 });
const told = signal<Told | null>(null);
/** The scene whose past the viewer may not see. */
const closed = signal<string | null>(null);
const isPlaying = signal(false);
const rate = signal<(typeof RATES)[number]>("1");

/** The newest instant that there is. */
function newest(): number {
  const last = (state.cameras.value ?? []).map(({ last }) => (last === null ? NaN : Date.parse(last))).filter(Number.isFinite);
  return last.length > 0 ? Math.max(...last) : Date.now();
}

/** The time that is shown. */
function shownTime(): number {
  return state.at.value ?? about.value?.millis ?? newest();
}

/** Goes to a time; to what is live where there is none yet. */
export function goTo(millis: number): void {
  if (millis >= newest()) goLive();
  else state.setTime(Math.round(millis));
}

export function goLive(): void {
  isPlaying.value = false;
  state.setTime(null);
  stretch.value = following(stretch.value, newest());
}

function step(millis: number): void {
  isPlaying.value = false;
  goTo(shownTime() + millis);
}

function read(answer: Answer, scene: string): Told {
  const range = (pair: string[]): [number, number] => [Date.parse(pair[0] ?? ""), Date.parse(pair[1] ?? "")];
  return {
    scene,
    stepMillis: answer.resolution_secs * 1e3,
    rows: answer.cameras.map(({ camera, ranges, activity }) => ({
      camera,
      ranges: ranges.map(range),
      activity: activity.map(({ at, moving_share }) => ({ at: Date.parse(at), share: moving_share })),
    })),
    events: answer.events.map((event) => ({ at: Date.parse(event.time), text: sayWord("event", event.kind) })),
  };
}

async function learn(): Promise<void> {
  const scene = state.scene.value;
  if (!scene || document.hidden || closed.value === scene.id) return;
  const { from, to } = stretch.value;
  // A little more on both sides, so that moving does not show emptiness.
  const beside = (to - from) / 4;
  const seconds = Math.ceil((to - from) / 1e3 / MOST_BARS / LEAST_STEP_SECS) * LEAST_STEP_SECS;
  const query = {
    from: new Date(Math.max(from - beside, 0)).toISOString(),
    to: new Date(to + beside).toISOString(),
    resolution: Math.max(LEAST_STEP_SECS, seconds),
  };
  try {
    const answer = await content(api.GET("/api/v1/scenes/{id}/timeline", { params: { path: { id: scene.id }, query } }));
    told.value = read(answer, scene.id);
  } catch (error) {
    // What goes wrong else is said by the picture and the bar at the top; the timeline keeps what it knew.
    if (error instanceof Trouble && error.status === 403) closed.value = scene.id;
  }
}

/** Height of the timeline's text, pixels: large screens stand farther away. */
function textHeight(): number {
  return 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
}

/** Columns beside which time begins. */
function gutter(canvas: HTMLCanvasElement): number {
  return Math.min(canvas.clientWidth * GUTTER_SHARE, textHeight() * GUTTER_LINES);
}

function draw(canvas: HTMLCanvasElement): void {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const scale = devicePixelRatio;
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d");
  if (!context || width === 0) return;
  const style = getComputedStyle(canvas);
  const color = (name: string) => style.getPropertyValue(`--${name}`).trim();
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  const { from, to } = stretch.value;
  const [text, left] = [textHeight(), gutter(canvas)];
  const x = (millis: number) => left + ((millis - from) / (to - from)) * (width - left);
  const { at, step } = ticks(stretch.value, (width - left) / (text * 8));
  context.font = `${text}px ${style.fontFamily}`;
  context.save();
  context.beginPath();
  context.rect(left, 0, width - left, height);
  context.clip();
  context.textBaseline = "top";
  for (const tick of at) {
    context.fillStyle = color("line");
    context.fillRect(Math.round(x(tick)), 0, 1, height);
    context.fillStyle = color("quiet");
    context.fillText(label(tick, step), x(tick) + 4, 2);
  }
  const known = told.value;
  const rows = known && known.scene === state.scene.value?.id ? known.rows : [];
  const top = text * 1.6;
  const each = (height - top - 8) / Math.max(rows.length, 1);
  const tall = Math.max(each - 3, 2);
  rows.forEach(({ ranges, activity }, i) => {
    const y = top + i * each;
    context.fillStyle = color("bar");
    for (const [start, end] of ranges) context.fillRect(x(start), y, Math.max(x(end) - x(start), 1), tall);
    context.fillStyle = color("accent");
    for (const { at: start, share } of activity) {
      // A share of a hundredth of the picture is much already.
      const part = Math.min(1, Math.sqrt(share * 50)) * tall;
      const [begin, end] = [x(start), x(start + (known?.stepMillis ?? 0))];
      context.fillRect(begin, y + tall - part, Math.max(end - begin - 1, 1), Math.max(part, share > 0 ? 1 : 0));
    }
  });
  context.fillStyle = color("wait");
  for (const { at: when } of known?.events ?? []) context.fillRect(x(when) - 1, height - 8, 3, 8);
  const place = x(shownTime());
  context.fillStyle = color("bad");
  context.fillRect(Math.round(place) - 1, 0, 2, height);
  context.restore();
  if (tall < text) return;
  context.textBaseline = "middle";
  context.fillStyle = color("ink");
  rows.forEach(({ camera }, i) => {
    const name = state.cameras.value?.find(({ id }) => id === camera)?.name ?? camera;
    context.fillText(name, 4, top + i * each + tall / 2, left - 10);
  });
}

/** Plays from the shown time, as fast as is chosen, until what is live. */
function play(): () => void {
  let before = performance.now();
  const timer = setInterval(() => {
    const now = performance.now();
    const passed = (now - before) * Number(rate.value);
    before = now;
    // A picture that is not there yet is waited for: else slow machines would skip most of what they play.
    const isShown = about.value === null || Math.abs((state.at.value ?? 0) - about.value.millis) < Math.max(1_500, passed * 4);
    if (state.at.value !== null && isShown) goTo(state.at.value + passed);
    stretch.value = following(stretch.value, shownTime());
  }, STEP_MILLIS);
  return () => clearInterval(timer);
}

const KEYS: Record<string, (shift: boolean) => void> = {
  ArrowLeft: (shift) => step(shift ? -STEP_MILLIS * 100 : -STEP_MILLIS),
  ArrowRight: (shift) => step(shift ? STEP_MILLIS * 100 : STEP_MILLIS),
  PageDown: () => step(-60e3),
  PageUp: () => step(60e3),
  End: goLive,
  "+": () => (stretch.value = zoomed(stretch.value, shownTime(), 0.7)),
  "=": () => (stretch.value = zoomed(stretch.value, shownTime(), 0.7)),
  "-": () => (stretch.value = zoomed(stretch.value, shownTime(), 1 / 0.7)),
  " ": togglePlay,
};

function togglePlay(): void {
  if (state.at.value === null) state.setTime(Math.round(shownTime()));
  isPlaying.value = !isPlaying.value;
}

function listen(canvas: HTMLCanvasElement): () => void {
  const ending = new AbortController();
  const { signal: ended } = ending;
  const millisAt = (clientX: number) => {
    const box = canvas.getBoundingClientRect();
    const { from, to } = stretch.value;
    const left = gutter(canvas);
    return from + (Math.max(clientX - box.left - left, 0) / (box.width - left)) * (to - from);
  };
  let grabbed: { x: number; moved: number } | null = null;
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30;
    const { from, to } = stretch.value;
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      stretch.value = shifted(stretch.value, ((event.deltaX * unit) / (canvas.clientWidth - gutter(canvas))) * (to - from));
    } else {
      stretch.value = zoomed(stretch.value, millisAt(event.clientX), Math.exp(event.deltaY * unit * ZOOM_PER_PIXEL));
    }
  }, { signal: ended, passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    grabbed = { x: event.clientX, moved: 0 };
  }, { signal: ended });
  canvas.addEventListener("pointermove", (event) => {
    if (!grabbed) return;
    const { from, to } = stretch.value;
    const by = event.clientX - grabbed.x;
    grabbed = { x: event.clientX, moved: grabbed.moved + Math.abs(by) };
    if (grabbed.moved > CLICK_PIXELS) stretch.value = shifted(stretch.value, (-by / (canvas.clientWidth - gutter(canvas))) * (to - from));
  }, { signal: ended });
  canvas.addEventListener("pointerup", (event) => {
    if (grabbed && grabbed.moved <= CLICK_PIXELS) goTo(millisAt(event.clientX));
    grabbed = null;
  }, { signal: ended });
  canvas.addEventListener("pointercancel", () => (grabbed = null), { signal: ended });
  canvas.addEventListener("keydown", (event) => {
    const key = KEYS[event.key];
    if (!key || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    key(event.shiftKey);
  }, { signal: ended });
  return () => ending.abort();
}

export function Timeline() {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const element = canvas.current;
    if (!element) return undefined;
    const ask = () => void learn();
    let soon: ReturnType<typeof setTimeout> | undefined;
    const stopAsking = effect(() => {
      dependOn(stretch, state.scene);
      clearTimeout(soon);
      soon = setTimeout(ask, SOON_MILLIS);
    });
    const again = setInterval(() => {
      if (state.at.value === null) stretch.value = following(stretch.value, newest());
      ask();
    }, ASK_MILLIS);
    let frame = 0;
    const stopDrawing = effect(() => {
      dependOn(stretch, told, state.at, about, tick);
      cancelAnimationFrame(frame);
      frame = requestAnimationFrame(() => draw(element));
    });
    const stopListening = listen(element);
    return () => {
      clearTimeout(soon);
      clearInterval(again);
      cancelAnimationFrame(frame);
      stopAsking();
      stopDrawing();
      stopListening();
      isPlaying.value = false;
    };
  }, []);
  useEffect(() => (isPlaying.value ? play() : undefined), [isPlaying.value]);
  const isLive = state.at.value === null;
  const shown = shownTime();
  const { from, to } = stretch.value;
  return (
    <section class="time" aria-label={say("time.title")}>
      <div class="time-bar">
        <button type="button" onClick={() => step(-STEP_MILLIS)} aria-label={say("time.back")} title={say("time.back")}>‹</button>
        <button type="button" onClick={togglePlay} aria-pressed={isPlaying.value}>{say(isPlaying.value ? "time.pause" : "time.play")}</button>
        <button type="button" onClick={() => step(STEP_MILLIS)} disabled={isLive} aria-label={say("time.forward")} title={say("time.forward")}>›</button>
        <button type="button" class={isLive ? "is-on" : ""} onClick={goLive} aria-pressed={isLive} title={say("time.live.title")}>{say("time.live")}</button>
        <label class="inline">
          {say("time.rate")}{" "}
          <select value={rate.value} onChange={(event) => (rate.value = RATES.find((known) => known === event.currentTarget.value) ?? "1")}>
            {RATES.map((value) => <option key={value} value={value}>{value} ×</option>)}
          </select>
        </label>
        <output class="now">{clock(shown, !isLive)}</output>
        <span class="pair">
          <button type="button" onClick={() => (stretch.value = zoomed(stretch.value, shown, 1 / 0.6))} aria-label={say("time.out")} title={say("time.out")}>−</button>
          <span class="quiet">{duration((to - from) / 1e3)}</span>
          <button type="button" onClick={() => (stretch.value = zoomed(stretch.value, shown, 0.6))} aria-label={say("time.in")} title={say("time.in")}>+</button>
        </span>
      </div>
      <canvas ref={canvas} class="strip" role="slider" tabIndex={0} aria-label={say("time.strip")} title={say("time.help")}
        aria-valuemin={Math.round(from)} aria-valuemax={Math.round(to)} aria-valuenow={Math.round(shown)}
        aria-valuetext={isLive ? say("time.now") : clock(shown, true)} data-rows={told.value?.rows.length ?? 0} />
      {closed.value !== null && closed.value === state.scene.value?.id && <p class="quiet">{say("time.none")}</p>}
    </section>
  );
}
