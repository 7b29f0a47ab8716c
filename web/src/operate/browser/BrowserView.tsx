// The fused view as this browser draws it: stands where `FusedView` does, over the same stage. It is mounted by who draws (`choose.ts`)
// and loaded only then:
//
//   const BrowserView = lazy(() => import("./browser/BrowserView"));   // or an import() in an effect
//   {choice.value.by === "browser" ? <BrowserView /> : <FusedView />}
//
// It tells `state.shownFused` what is on the screen as the fused view does, and `choose.rate` how fast it is.

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { ask } from "../../ask";
import { lostSince } from "../../connection";
import { dependOn } from "../../depend";
import { HeadsetButton } from "../../spatial/HeadsetButton";
import type { Health } from "../../spatial/stage";
import { say } from "../../strings";
import { tick } from "../../tick";
import { clock, duration } from "../../units";
import { Stage } from "../Stage";
import { readField } from "../orbit";
import { allowed } from "../rights";
import { sceneDocument } from "../scenery";
import * as state from "../state";
import { people, peopleAt } from "../tracking";
import { MEASURE_MILLIS, isLost, rate } from "./choose";
import { type Drawn, Drawing } from "./drawing";
import { NO_GAINS, followGains } from "./gains";
import "./browser.css";

/** Nothing newer for so long is said to be old. */
const OLD_MILLIS = 3_000;
/** A graphics card that does not come back within so long leaves drawing to the daemon, for a while. */
const LOST_MILLIS = 3_000;
const RETRY_MILLIS = 30_000;
/** How often it is told what is shown. */
const TELL_MILLIS = 100;

const health = signal<Health>("fine");
const drawing = signal<Drawing | null>(null);
const drawn = signal<Drawn | null>(null);

/** Learns from where the scene is seen if nobody says otherwise: the daemon knows. */
async function learnOwnView(scene: string, signal: AbortSignal): Promise<void> {
  const told = sceneDocument.peek()?.view;
  const [eye, target] = [told?.eye_m, told?.target_m];
  if (told && eye?.length === 3 && target?.length === 3) {
    state.learnView({ eye: eye as [number, number, number], target: target as [number, number, number], fov: told.fov_deg ?? 45 });
    return;
  }
  const path = `/api/v1/scenes/${encodeURIComponent(scene)}/view.jpg`;
  const response = await ask(path, { width: 16, height: 16, entities: "none", quality: "draft" }, { signal });
  const view = readField(response.headers.get("Videofields-View"));
  if (view && state.scene.peek()?.id === scene) state.learnView(view);
}

/** Draws into `host` until the answered function is called. */
function follow(host: HTMLElement): () => void {
  const ending = new AbortController();
  let toldAt = 0;
  let firstAt = 0;
  let lostTimer: ReturnType<typeof setTimeout> | undefined;
  const made = new Drawing(host, (next) => {
    health.value = next;
    clearTimeout(lostTimer);
    if (next !== "lost") return;
    lostTimer = setTimeout(() => {
      isLost.value = true;
      setTimeout(() => (isLost.value = false), RETRY_MILLIS);
    }, LOST_MILLIS);
  }, (told) => {
    const { frames, rate: now } = told;
    const millis = performance.now();
    const isMeasuring = rate.peek() === null && frames.size > 0;
    if (isMeasuring) {
      // What is made ready with the first pictures is not what the later ones take.
      if (firstAt === 0 && made.stage.pace.count > 3) firstAt = millis;
      if (firstAt > 0 && millis - firstAt > MEASURE_MILLIS) rate.value = now;
      else made.stage.redraw();
    }
    if (millis - toldAt < TELL_MILLIS) return;
    [toldAt, drawn.value] = [millis, told];
    const view = state.looking.peek();
    if (frames.size > 0) state.shownFused.value = { millis: Math.max(...frames.values()), frames, view };
  });
  drawing.value = made;
  const sizes = new ResizeObserver(made.stage.resize);
  sizes.observe(host);
  const stops = [
    effect(() => {
      const document = sceneDocument.value;
      const live = allowed("live");
      if (document) made.show(document, (document.cameras ?? []).map(({ id }) => id).filter((id) => live.includes(id)));
    }),
    effect(() => {
      const view = state.looking.value;
      const scene = state.scene.value?.id;
      if (view) made.look(view);
      else if (scene !== undefined && sceneDocument.value) void learnOwnView(scene, ending.signal).catch(() => null);
    }),
    effect(() => made.setEntities(state.entities.value !== "none")),
    effect(() => made.setSeeThrough(state.seeThrough.value === "on")),
    effect(() => {
      const id = state.scene.value?.id;
      made.setGains(NO_GAINS);
      if (id === undefined || state.colors.value !== "even") return undefined;
      const gone = new AbortController();
      void followGains(id, (gains) => made.setGains(gains), gone.signal);
      return () => gone.abort();
    }),
    effect(() => made.setKnown([...people.value.values()], peopleAt.value)),
    effect(() => {
      made.stage.isPaced = state.quality.value !== "exact";
      made.stage.redraw();
    }),
  ];
  return () => {
    ending.abort();
    clearTimeout(lostTimer);
    stops.forEach((stop) => stop());
    sizes.disconnect();
    made.dispose();
    drawing.value = null;
    drawn.value = null;
    health.value = "fine";
    state.shownFused.value = null;
  };
}

/** What must be said of the picture, the gravest first. */
function sayings(made: Drawing): string[] {
  dependOn(tick);
  const age = performance.now() - made.heardAt;
  if (age > OLD_MILLIS || lostSince.value !== null) return [say("view.old", { age: duration(age / 1e3) })];
  const said = [];
  const silent = made.silent(OLD_MILLIS);
  if (silent.length > 0) said.push(say("view.behind", { cameras: silent.map(state.nameOf).join(", ") }));
  const all = state.scene.value?.cameras ?? [];
  const live = allowed("live");
  if (all.some((id) => !live.includes(id))) said.push(say("view.restricted"));
  return said;
}

export default function BrowserView() {
  const stage = useRef<HTMLDivElement>(null);
  const host = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!host.current) return undefined;
    try {
      return follow(host.current);
    } catch {
      // There is no WebGL2 after all: the daemon draws.
      isLost.value = true;
      return undefined;
    }
  }, []);
  const shown = state.shownFused.value;
  const said = drawing.value && shown ? sayings(drawing.value) : [];
  const isOld = shown !== null && drawing.value !== null && performance.now() - drawing.value.heardAt > OLD_MILLIS;
  const scene = state.scene.value;
  return (
    <Stage stage={stage} isOld={isOld} time={shown?.millis}>
      <div ref={host} class="drawn-here" role="img" aria-label={scene ? say("view.alt", { scene: scene.name }) : ""}
        data-rate={drawn.value?.rate.toFixed(1)} data-measured={rate.value?.toFixed(1)} data-cameras={drawn.value?.cameras.length}
        data-people={drawn.value?.people} data-opened={drawn.value?.opened} />
      {!shown && <p class="waiting">{say(state.scenes.value?.length === 0 ? "scene.none" : "view.waiting")}</p>}
      {shown && (
        <p class="stamp">
          <span class={isOld ? "is-past" : "is-live"}>{say("view.live")}</span>
          <time dateTime={new Date(shown.millis).toISOString()}>{clock(shown.millis, false)}</time>
        </p>
      )}
      {said.length > 0 && <div class="veils" role="status">{said.map((text) => <p key={text.slice(0, 12)} class="veil">{text}</p>)}</div>}
      {shown && drawing.value?.surfaces && (
        <HeadsetButton stage={drawing.value.stage} surfaces={drawing.value.surfaces} view={() => state.looking.peek()}
          onView={state.setView} onDrag={() => state.choose("move", "fly", "orbit")} />
      )}
      {health.value === "lost" && <p class="veil at-top" role="status">{say("spatial.lost")}</p>}
    </Stage>
  );
}
