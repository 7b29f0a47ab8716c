// Which time is shown and how it goes on: going somewhere, playing both ways, single frames, back to what is live; and what there
// is of the scene's time.

import { effect, signal } from "@preact/signals";
import { Trouble, api, content, send, told as toldOf } from "../ask";
import type { paths } from "../contract.gen";
import { dependOn } from "../depend";
import { say, sayWord } from "../strings";
import { duration } from "../units";
import { instant, millisOf } from "./moments";
import { allowed } from "./rights";
import * as state from "./state";
import { type Direction, type Probe, nextInstant } from "./steps";
import { type Row, type Stretch, beyondGap, following, isCovered, nearestCovered } from "./timescale";

type Answer = paths["/api/v1/scenes/{id}/timeline"]["get"]["responses"]["200"]["content"]["application/json"];
export type Told = { scene: string; stepMillis: number; rows: Row[]; events: { at: number; camera: string; text: string }[] };

const ASK_MILLIS = 4_000;
const SOON_MILLIS = 200;
const MOST_BARS = 600;
const LEAST_STEP_SECS = 60;
/** How often time goes on while it plays. */
const PLAY_MILLIS = 100;
/** How far frames are apart until that is known. */
const USUAL_FRAME_MILLIS = 40;
const DAY_MILLIS = 86_400e3;
const LONGEST_MILLIS = 400 * DAY_MILLIS;

export const RATES = ["0.1", "0.25", "0.5", "1", "2", "4", "8", "16"] as const;
export type Rate = (typeof RATES)[number];

/** The stretch of time that the timeline shows. */
export const stretch = signal<Stretch>({ from: Date.now() - 120e3, to: Date.now() + 4e3 });
export const told = signal<Told | null>(null);
/** The scene whose past the viewer may not see. */
export const closed = signal<string | null>(null);
/** Which way it plays; null while it stands. */
export const playing = signal<Direction | null>(null);
export const rate = signal<Rate>("1");
/** The part of time that is chosen to be exported. */
export const range = signal<Stretch | null>(null);
/** What is to be said of the last step or jump. */
export const notice = signal<string | null>(null);

/** What is known of the time of the scene that is shown. */
export function rows(): readonly Row[] {
  return told.value?.scene === state.scene.value?.id ? (told.value?.rows ?? []) : [];
}

/** The newest instant that there is. */
export function newest(): number {
  const last = (state.cameras.value ?? []).map(({ last }) => millisOf(last)).filter(Number.isFinite);
  return last.length > 0 ? Math.max(...last) : Date.now();
}

/** The time that is shown. */
export function shownTime(): number {
  return state.at.value ?? state.shown.value?.millis ?? newest();
}

/** Goes to a time; to what is live where there is none yet. */
export function goTo(millis: number): void {
  notice.value = null;
  if (millis >= newest()) goLive();
  else state.jumpTo(millis);
  if (playing.peek() === null) stretch.value = following(stretch.peek(), shownTime());
}

export function goLive(): void {
  [playing.value, notice.value] = [null, null];
  state.jumpTo(null);
  stretch.value = following(stretch.peek(), newest());
}

/** Goes so far on or back. */
export function skip(millis: number): void {
  playing.value = null;
  goTo(shownTime() + millis);
}

/** Goes to what was typed, or to what is nearest to it and says so. Throws `Trouble`. */
export async function jump(millis: number): Promise<void> {
  const scene = state.scene.peek();
  if (!scene) return;
  playing.value = null;
  for (const beside of [2e3, DAY_MILLIS, LONGEST_MILLIS]) {
    const query = { from: instant(Math.max(0, millis - beside)), to: instant(millis + beside), resolution: Math.max(60, Math.ceil(beside / 2e6)) };
    const answer = await content(api.GET("/api/v1/scenes/{id}/timeline", { params: { path: { id: scene.id }, query } }));
    const nearest = nearestCovered(read(answer, scene.id).rows, millis);
    if (nearest === null) continue;
    goTo(nearest);
    stretch.value = following(stretch.peek(), nearest);
    const away = Math.abs(nearest - millis);
    if (away > 1_000) notice.value = say("time.nearest", { away: duration(away / 1e3) });
    return;
  }
  notice.value = say("time.nothing");
}

let frameMillis = USUAL_FRAME_MILLIS;
let wanted = 0;
let stepping: Promise<void> | null = null;

/** The frame of a camera nearest to a time, asked of the daemon without its picture. */
function probeOf(camera: string): Probe {
  return async (millis) => {
    const path = `/api/v1/cameras/${encodeURIComponent(camera)}/frame.jpg?t=${encodeURIComponent(instant(millis))}`;
    const response = await send(path, { method: "HEAD" });
    if (response.ok) return millisOf(response.headers.get("Videofields-Time"));
    if (response.status === 404) return null;
    throw new Trouble(say("trouble.status", { status: response.status }), response.status);
  };
}

/** The cameras whose frames are stepped through: the one that is shown alone, or all of the fused picture. */
function stepped(): string[] {
  const opened = state.openedCamera.peek();
  return opened === undefined ? [...(state.shown.peek()?.frames.keys() ?? [])] : [opened];
}

/** One frame on or back, to the frame's own time. Steps that come faster than they are found are done one after the other. */
export function step(direction: Direction): Promise<void> {
  playing.value = null;
  wanted += direction;
  stepping ??= takeSteps().finally(() => (stepping = null));
  return stepping;
}

async function takeSteps(): Promise<void> {
  while (wanted !== 0) {
    const direction: Direction = wanted > 0 ? 1 : -1;
    wanted -= direction;
    try {
      await takeStep(direction);
    } catch (error) {
      [wanted, notice.value] = [0, toldOf(error)];
    }
  }
}

async function takeStep(direction: Direction): Promise<void> {
  const cameras = stepped();
  const from = shownTime();
  const next = (await nextInstant(cameras.map(probeOf), from, direction, frameMillis)) ?? beyondGap(rows(), cameras, from, direction);
  if (next === null) {
    notice.value = say(direction > 0 ? "time.noNext" : "time.noBefore");
    return;
  }
  frameMillis = Math.min(Math.max(Math.abs(next - from), 1), 1_000);
  notice.value = null;
  state.jumpTo(next);
  stretch.value = following(stretch.peek(), next);
}

/** Plays that way, or stands. */
export function togglePlay(direction: Direction): void {
  if (state.at.peek() === null && direction > 0) return void (playing.value = null);
  if (state.at.peek() === null) state.jumpTo(shownTime());
  playing.value = playing.peek() === direction ? null : direction;
}

/** Stands at what is shown. */
export function pause(): void {
  if (state.at.peek() === null) state.jumpTo(shownTime());
  playing.value = null;
}

/** Plays from the shown time on, as fast as is chosen, until what is live or the beginning. */
function play(direction: Direction): () => void {
  let before = performance.now();
  const timer = setInterval(() => {
    const now = performance.now();
    const passed = (now - before) * Number(rate.peek());
    before = now;
    const [at, shown] = [state.at.peek(), state.shown.peek()];
    if (at === null) return;
    // A picture that is not there yet is waited for: else slow machines would skip most of what they play.
    const isShown = shown === null || Math.abs(at - shown.millis) < Math.max(1_500, passed * 4);
    if (!isShown && isCovered(rows(), at)) return;
    const next = at + direction * passed;
    const beyond = isCovered(rows(), next) ? next : beyondGap(rows(), null, next, direction);
    const there = beyond ?? (direction > 0 ? next : null);
    if (there !== null && there >= newest()) goLive();
    else if (there !== null) state.setTime(there);
    else [playing.value, notice.value] = [null, say("time.noBefore")];
    stretch.value = following(stretch.peek(), shownTime());
  }, PLAY_MILLIS);
  return () => clearInterval(timer);
}

function read(answer: Answer, scene: string): Told {
  return {
    scene,
    stepMillis: answer.resolution_secs * 1e3,
    rows: answer.cameras.map(({ camera, ranges, activity }) => ({
      camera,
      ranges: ranges.map(([from, to]) => [millisOf(from), millisOf(to)] as const),
      activity: activity.map(({ at, moving_share }) => ({ at: millisOf(at), share: moving_share })),
    })),
    events: answer.events.map((event) => ({ at: millisOf(event.time), camera: event.camera, text: sayWord("event", event.kind) })),
  };
}

async function learn(): Promise<void> {
  const scene = state.scene.peek();
  if (!scene || document.hidden || closed.peek() === scene.id) return;
  if (allowed("history").length === 0) {
    closed.value = scene.id;
    return;
  }
  const { from, to } = stretch.peek();
  // A little more on both sides, so that moving does not show emptiness.
  const beside = (to - from) / 4;
  const seconds = Math.ceil((to - from) / 1e3 / MOST_BARS / LEAST_STEP_SECS) * LEAST_STEP_SECS;
  const query = { from: instant(Math.max(from - beside, 0)), to: instant(to + beside), resolution: Math.max(LEAST_STEP_SECS, seconds) };
  try {
    const answer = await content(api.GET("/api/v1/scenes/{id}/timeline", { params: { path: { id: scene.id }, query } }));
    told.value = read(answer, scene.id);
  } catch (error) {
    // What goes wrong else is said by the picture and the bar at the top; the timeline keeps what it knew.
    if (error instanceof Trouble && error.status === 403) closed.value = scene.id;
  }
}

/** Keeps time going until the answered function is called. */
export function attend(): () => void {
  let soon: ReturnType<typeof setTimeout> | undefined;
  const stopAsking = effect(() => {
    dependOn(stretch, state.scene);
    clearTimeout(soon);
    soon = setTimeout(() => void learn(), SOON_MILLIS);
  });
  const again = setInterval(() => {
    if (state.at.peek() === null) stretch.value = following(stretch.peek(), newest());
    void learn();
  }, ASK_MILLIS);
  const stopPlaying = effect(() => (playing.value === null ? undefined : play(playing.value)));
  return () => {
    clearTimeout(soon);
    clearInterval(again);
    stopAsking();
    playing.value = null;
    stopPlaying();
  };
}
