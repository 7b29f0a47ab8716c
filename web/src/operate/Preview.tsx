// What was to be seen where the pointer rests over the timeline.

import { useEffect, useRef, useState } from "preact/hooks";
import { say } from "../strings";
import { clock } from "../units";
import * as clockwork from "./clockwork";
import { printed } from "./orbit";
import { type Wish, known, look } from "./previews";
import * as state from "./state";
import { hovered } from "./strip";

const REST_MILLIS = 140;
/** Pictures a few pixels apart are taken for one. */
const PIXELS = 3;
const LEAST_BESIDE_MILLIS = 60;

function wishOf(width: number): Wish | null {
  const [at, scene] = [hovered.value, state.scene.value?.id];
  const isOver = clockwork.rows().some(({ ranges }) => ranges.some(([from, to]) => at && at.millis >= from && at.millis <= to));
  if (!at || scene === undefined || !isOver) return null;
  const { from, to } = clockwork.stretch.value;
  const view = state.view.value;
  return {
    scene,
    camera: at.camera ?? state.openedCamera.value ?? null,
    millis: at.millis,
    beside: Math.max(((to - from) / Math.max(width, 1)) * PIXELS, LEAST_BESIDE_MILLIS),
    view: view ? printed(view) : {},
  };
}

export function Preview({ width }: { width: number }) {
  const at = hovered.value;
  const wish = wishOf(width);
  const [url, setUrl] = useState<string | null>(null);
  const asking = useRef<AbortController | null>(null);
  const key = JSON.stringify(wish);
  useEffect(() => {
    const there = wish ? known(wish) : null;
    if (there !== undefined) setUrl(there);
    if (!wish || there !== undefined) return undefined;
    const timer = setTimeout(() => {
      asking.current?.abort();
      const ending = new AbortController();
      asking.current = ending;
      look(wish, ending.signal).then((picture) => {
        if (!ending.signal.aborted) setUrl(picture);
      }, () => null);
    }, REST_MILLIS);
    return () => clearTimeout(timer);
  }, [key]);
  useEffect(() => () => asking.current?.abort(), []);
  if (!at) return null;
  const half = 7.6;
  return (
    <div class="preview" aria-hidden="true" data-preview={url === null ? "" : "shown"} style={{ left: `clamp(${half}rem, ${at.x}px, calc(100% - ${half}rem))` }}>
      {url === null ? <span class="quiet">{say(wish ? "time.preview.wait" : "time.preview.none")}</span> : <img src={url} alt="" />}
      <span>{wish?.camera ? `${state.nameOf(wish.camera)} · ` : ""}{clock(at.millis, clockwork.stretch.value.to - clockwork.stretch.value.from < 60e3)}</span>
      {at.event !== null && <span>{at.event}</span>}
    </div>
  );
}
