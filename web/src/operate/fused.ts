// Asks for one fused picture after another from where the viewer stands: one at a time, so none ever queue up, and what is asked
// for is always the newest wish. A picture of a fixed time is asked for once.

import { effect, signal } from "@preact/signals";
import { Trouble, ask, told } from "../ask";
import { dependOn } from "../depend";
import { pauser, seen } from "../pause";
import { show } from "../picture";
import { instant, millisOf } from "./moments";
import { type View, printed, readField } from "./orbit";
import * as state from "./state";

const INTERVAL_MILLIS = 250;
const MOVING_INTERVAL_MILLIS = 30;
const STILL_AFTER_MILLIS = 350;
const AFTER_TROUBLE_MILLIS = 1_500;
const MOST_COLUMNS = 3_840;
const LEAST_COLUMNS = 800;
/** Resting pictures that take longer become smaller, those that take less larger again. */
const SLOW_MILLIS = 900;
const QUICK_MILLIS = 300;
const SOURCE_BEHIND_SECS = 2;

/** What is told of the picture that is shown. */
export type About = {
  scene: string;
  view: View | null;
  millis: number;
  receivedAt: number;
  tookMillis: number;
  picturesPerSecond: number;
  stages: string;
  sources: { camera: string; millis: number; behindSecs: number }[];
  gaps: string[];
  plan: string[];
  isRestricted: boolean;
};

/** Null until there is a picture. */
export const about = signal<About | null>(null);
/** Why there is no newer picture; null while all is well. */
export const trouble = signal<string | null>(null);
/** Since when pictures are asked for in vain, of `performance.now()`. */
export const failingSince = signal<number | null>(null);

/** Cameras of a picture whose frames are much older than it says. */
export function late({ sources }: About): string[] {
  return sources.filter(({ behindSecs }) => behindSecs > SOURCE_BEHIND_SECS).map(({ camera }) => camera);
}

const list = (text: string | null) => (text ?? "").split(",").filter(Boolean);

function readAbout(response: Response, scene: string, tookMillis: number, rate: number): About {
  const field = (name: string) => response.headers.get(name);
  const millis = millisOf(field("Videofields-Time"));
  const sources = list(field("Videofields-Sources")).map((source) => {
    const [camera = "", seenAt = ""] = source.split("=");
    return { camera, millis: millisOf(seenAt), behindSecs: (millis - millisOf(seenAt)) / 1e3 };
  });
  return {
    scene,
    view: readField(field("Videofields-View")),
    millis,
    receivedAt: performance.now(),
    tookMillis,
    picturesPerSecond: rate,
    stages: (field("Server-Timing") ?? "").replaceAll(";dur=", " ").replace(/(\d\.\d)\d+/g, "$1"),
    sources,
    gaps: list(field("Videofields-Gaps")),
    plan: list(field("Videofields-Plan")),
    isRestricted: field("Videofields-Restricted") === "true",
  };
}

/** Shows pictures in `image`, as large as `stage`, until the answered function is called. */
export function follow(stage: HTMLElement, image: HTMLImageElement): () => void {
  const ending = new AbortController();
  const rest = pauser();
  let movedAt = -Infinity;
  let stillTimer: ReturnType<typeof setTimeout> | undefined;
  let recent: number[] = [];
  let shownWish = "";
  let mostColumns = 1_600;
  let tag: string | null = null;

  // Whoever turns the view sees small pictures at once, and the whole one when it rests.
  let before: View | null = null;
  const stopViews = state.looking.subscribe((view) => {
    const isMove = before !== null && view !== null;
    before = view;
    rest.wake();
    if (!isMove) return;
    movedAt = performance.now();
    clearTimeout(stillTimer);
    stillTimer = setTimeout(rest.wake, STILL_AFTER_MILLIS);
  });
  const stopWishes = effect(() => {
    dependOn(state.scene, state.entities, state.quality, state.seeThrough, state.colors, state.effects, state.at);
    rest.wake();
  });
  const sizes = new ResizeObserver(rest.wake);
  sizes.observe(stage);

  const refresh = async (isMoving: boolean) => {
    const scene = state.scene.value;
    // Behind a camera's own picture it rests.
    if (!scene || stage.clientWidth < 16) return;
    const [view, at] = [state.looking.value, state.at.value];
    const columns = Math.min(stage.clientWidth * devicePixelRatio, isMoving ? LEAST_COLUMNS : mostColumns);
    const path = `/api/v1/scenes/${encodeURIComponent(scene.id)}/view.jpg`;
    const wish = {
      width: Math.max(16, Math.round(columns)),
      height: Math.max(16, Math.round((columns * stage.clientHeight) / stage.clientWidth)),
      ...(view ? printed(view) : {}),
      ...(at === null ? {} : { t: instant(at) }),
      entities: state.entities.value,
      quality: isMoving ? "draft" : state.quality.value,
      see_through: state.seeThrough.value,
      colors: state.colors.value,
      ...state.effects.value,
    };
    const text = JSON.stringify([path, wish]);
    // What was there at a fixed time stays as it was.
    if (at !== null && text === shownWish) return;
    const start = performance.now();
    const response = await ask(path, wish, { signal: ending.signal, tag: text === shownWish ? tag : null });
    if (scene !== state.scene.value) return;
    if (response.status === 304) {
      if (about.value) about.value = { ...about.value, receivedAt: performance.now() };
      return;
    }
    await show(image, response);
    if (ending.signal.aborted) return;
    const took = performance.now() - start;
    if (!isMoving && took > SLOW_MILLIS) mostColumns = Math.max(LEAST_COLUMNS, Math.round(mostColumns * 0.8));
    if (!isMoving && took < QUICK_MILLIS && columns >= mostColumns) mostColumns = Math.min(MOST_COLUMNS, Math.round(mostColumns * 1.25));
    [shownWish, tag] = [text, response.headers.get("ETag")];
    recent = [...recent, performance.now()].slice(-9);
    const span = performance.now() - (recent[0] ?? 0);
    const rate = recent.length > 1 ? ((recent.length - 1) * 1e3) / span : 0;
    const next = readAbout(response, scene.id, took, rate);
    if (!view && next.view) state.learnView(next.view);
    about.value = next;
    state.shownFused.value = { millis: next.millis, frames: new Map(next.sources.map(({ camera, millis }) => [camera, millis])), view: next.view };
  };

  const isOver = () => ending.signal.aborted;
  const run = async () => {
    while (!isOver()) {
      await seen();
      const start = performance.now();
      // The first picture is a small one too, since nothing is there yet.
      const isMoving = start - movedAt < STILL_AFTER_MILLIS || about.peek() === null;
      let pause = isMoving ? MOVING_INTERVAL_MILLIS : INTERVAL_MILLIS;
      try {
        await refresh(isMoving);
        if (isOver()) return;
        [trouble.value, failingSince.value] = [null, null];
      } catch (error) {
        if (isOver()) return;
        trouble.value = told(error);
        failingSince.value ??= start;
        // The renderer is busy, or the daemon silent: neither is helped by haste.
        pause = error instanceof Trouble ? AFTER_TROUBLE_MILLIS : INTERVAL_MILLIS;
      }
      await rest.pause(Math.max(0, pause - (performance.now() - start)));
    }
  };
  void run();
  return () => {
    ending.abort();
    rest.wake();
    clearTimeout(stillTimer);
    stopViews();
    stopWishes();
    sizes.disconnect();
    about.value = null;
    state.shownFused.value = null;
    if (image.src.startsWith("blob:")) URL.revokeObjectURL(image.src);
  };
}
