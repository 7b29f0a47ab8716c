// The fused view: the picture, what must be said over it, and how to move in it.

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { lostSince } from "../connection";
import { dependOn } from "../depend";
import { say } from "../strings";
import { tick } from "../tick";
import { clock, duration } from "../units";
import * as fused from "./fused";
import { Stage } from "./Stage";
import * as state from "./state";

/** A picture of now that is older than this is said to be old. */
const OLD_MILLIS = 3_000;
const hasPicture = signal(false);

const names = (ids: string[]) => ids.map(state.nameOf).join(", ");

/** What must be said of the picture, the gravest first. */
function sayings(): string[] {
  dependOn(tick);
  const shown = fused.about.value;
  if (!shown) return [];
  const said = [];
  const age = performance.now() - shown.receivedAt;
  const isOld = state.at.value === null ? age > OLD_MILLIS : fused.failingSince.value !== null;
  if (isOld || lostSince.value !== null) said.push(say("view.old", { age: duration(age / 1e3) }));
  const late = fused.late(shown);
  if (late.length > 0) said.push(say("view.behind", { cameras: names(late) }));
  if (shown.gaps.length > 0) said.push(say("view.gaps", { cameras: names(shown.gaps) }));
  if (shown.isRestricted) said.push(say("view.restricted"));
  return said;
}

export function FusedView() {
  const stage = useRef<HTMLDivElement>(null);
  const image = useRef<HTMLImageElement>(null);
  useEffect(() => {
    const [element, picture] = [stage.current, image.current];
    if (!element || !picture) return undefined;
    const stop = fused.follow(element, picture);
    const seenFirst = fused.about.subscribe((about) => (hasPicture.value = about !== null));
    return () => {
      stop();
      seenFirst();
    };
  }, []);
  const shown = fused.about.value;
  const said = sayings();
  const scene = state.scene.value;
  const isOld = said.length > 0 && (lostSince.value !== null || fused.failingSince.value !== null);
  const isLive = state.at.value === null;
  return (
    <Stage stage={stage} isOld={isOld} time={shown?.millis}>
      <img ref={image} class={hasPicture.value ? "" : "is-empty"} alt={hasPicture.value && scene ? say("view.alt", { scene: scene.name }) : ""} draggable={false} />
      {!hasPicture.value && <p class="waiting">{fused.trouble.value ?? say(state.scenes.value?.length === 0 ? "scene.none" : "view.waiting")}</p>}
      {shown && (
        <p class="stamp">
          <span class={isLive && !isOld ? "is-live" : "is-past"}>{say(isLive ? "view.live" : "view.past")}</span>
          <time dateTime={new Date(shown.millis).toISOString()}>{clock(shown.millis, !isLive)}</time>
        </p>
      )}
      {said.length > 0 && <div class="veils" role="status">{said.map((text) => <p key={text.slice(0, 12)} class="veil">{text}</p>)}</div>}
      {hasPicture.value && fused.trouble.value !== null && lostSince.value === null && <p class="veil at-top" role="status">{fused.trouble.value}</p>}
    </Stage>
  );
}

/** What the picture was made of. */
export function AboutPicture({ children }: { children: ComponentChildren }) {
  const shown = fused.about.value;
  const sources = shown?.sources.map(({ camera, behindSecs }) =>
    behindSecs > 0.05 ? say("fact.behind", { camera, seconds: behindSecs.toFixed(1) }) : camera,
  );
  return (
    <details class="more">
      <summary>{say("view.more")}</summary>
      {children}
      <dl class="facts">
        <div><dt>{say("fact.sources")}</dt><dd>{sources?.join(", ") || say("fact.nobody")}</dd></div>
        <div><dt>{say("fact.plan")}</dt><dd>{shown?.plan.join(", ") || say("fact.none")}</dd></div>
        <div>
          <dt>{say("fact.timing")}</dt>
          <dd>{shown && say("fact.rate", { millis: shown.tookMillis.toFixed(0), rate: shown.picturesPerSecond.toFixed(1) })}</dd>
          <dd class="quiet">{shown?.stages}</dd>
        </div>
      </dl>
    </details>
  );
}
