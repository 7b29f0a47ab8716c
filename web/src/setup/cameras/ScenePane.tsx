// The scene, in three dimensions or from above, with the camera's picture projected on it while everything moves.

import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { dependOn } from "../../depend";
import { Segments } from "../../parts/parts";
import { type LiveTexture, liveTexture } from "../../spatial/cameraTextures";
import { type Lens, lensOf } from "../../spatial/lens";
import { Projection, type Projector } from "../../spatial/projection";
import { type Stage, Viewport } from "../../spatial/Viewport";
import { say } from "../../strings";
import { type Calibration, calibrationOf, draft } from "../draft";
import * as edits from "./edits";
import * as eyeing from "./eyeing";
import { Handles } from "./Handles";
import { meant } from "./meaning";
import * as now from "./now";
import type { Pixel } from "./pairs";
import { texture, textureChanged } from "./pictures";
import { surfaces, surfacesChanged } from "./scene";
import { Places, SceneOverlay } from "./SceneOverlay";

const CLICK_PX = 4;
const WHEEL_LOG = 0.0016;
const PAN_PX = [8, 64] as const;
const ZOOM_STEP = 1.3;
const OTHERS_MILLIS = 5_000;

const lenses = new WeakMap<Calibration, Lens>();

/** The same lens for the same calibration: what it sees is worked out once. */
function lensKept(of: Calibration): Lens {
  const known = lenses.get(of) ?? lensOf(of);
  lenses.set(of, known);
  return known;
}

/** Projects the chosen camera's picture, and others' where that is wanted. */
function useProjection(stage: { value: Stage | null }, opacity: { value: number }, withOthers: { value: boolean }): void {
  const projection = useRef<Projection | null>(null);
  const others = useRef(new Map<string, LiveTexture>());
  useSignalEffect(() => {
    const [of, on] = [surfaces.value, stage.value];
    if (!of || !on) return undefined;
    const made = new Projection(of);
    projection.current = made;
    const detach = made.attach(on);
    return () => {
      detach();
      made.dispose();
      projection.current = null;
    };
  });
  useSignalEffect(() => {
    dependOn(surfacesChanged, textureChanged);
    stage.value?.redraw();
  });
  useSignalEffect(() => {
    const [of, on] = [draft.value, stage.value];
    dependOn(surfaces);
    if (!of || !on) return;
    const ownId = now.chosen.value?.id;
    const own = now.lens.value && texture.value && ownId !== undefined ? [{ id: ownId, lens: now.lens.value, picture: texture.value, opacity: opacity.value }] : [];
    const wanted = withOthers.value ? of.cameras.filter((camera) => camera.id !== ownId && now.isRunning(camera)) : [];
    const rest = wanted.flatMap(({ id }): Projector[] => {
      const calibration = calibrationOf(of, id);
      if (!calibration) return [];
      const picture = others.current.get(id) ?? liveTexture(id, { what: "background", everyMillis: OTHERS_MILLIS, onChange: on.redraw });
      others.current.set(id, picture);
      return [{ id, lens: lensKept(calibration), picture }];
    });
    for (const [id, picture] of others.current) {
      if (wanted.some((camera) => camera.id === id)) continue;
      picture.dispose();
      others.current.delete(id);
    }
    projection.current?.set([...own, ...rest]);
    on.redraw();
  });
  useEffect(() => () => {
    for (const picture of others.current.values()) picture.dispose();
    others.current.clear();
  }, []);
}

/** Clicks that mean places; from above also what moves the map. */
function usePointers(host: { current: HTMLDivElement | null }): void {
  useEffect(() => {
    const element = host.current;
    if (!element) return undefined;
    const ending = new AbortController();
    const { signal } = ending;
    const pointers = new Map<number, Pixel>();
    let down: Pixel | null = null;
    let asked = 0;
    const place = (event: MouseEvent): Pixel => {
      const box = element.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    const isButton = (event: Event) => (event.target as Element).closest("button") !== null;
    const isMap = () => eyeing.sight.value === "map";

    element.addEventListener("pointerdown", (event) => {
      if (isButton(event)) return;
      pointers.set(event.pointerId, place(event));
      down = event.button === 0 && pointers.size === 1 ? place(event) : null;
      if (!isMap()) return;
      event.stopPropagation();
      element.setPointerCapture(event.pointerId);
    }, { signal, capture: true });
    element.addEventListener("pointermove", (event) => {
      const at = place(event);
      const before = pointers.get(event.pointerId);
      if (before && isMap()) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
        if (other) eyeing.zoomMap(Math.hypot(at[0] - other[0], at[1] - other[1]) / Math.max(Math.hypot(before[0] - other[0], before[1] - other[1]), 1), other);
        else if (!down || Math.hypot(at[0] - down[0], at[1] - down[1]) >= CLICK_PX) {
          down = null;
          eyeing.panMap([at[0] - before[0], at[1] - before[1]]);
        }
        event.stopPropagation();
      }
      if (before) pointers.set(event.pointerId, at);
      if (before || isButton(event) || now.how.value !== "pairs") return;
      cancelAnimationFrame(asked);
      const isExact = event.altKey;
      asked = requestAnimationFrame(() => (now.pointed.value = meant(at, isExact)));
    }, { signal, capture: true });
    const up = (event: PointerEvent) => {
      const isOwn = pointers.delete(event.pointerId);
      const [from, at] = [down, place(event)];
      if (!isOwn || !from || event.type !== "pointerup") return;
      down = null;
      if (Math.hypot(at[0] - from[0], at[1] - from[1]) >= CLICK_PX || now.how.value !== "pairs") return;
      const to = meant(at, event.altKey);
      if (to) edits.offerPlace(to.place);
    };
    element.addEventListener("pointerup", up, { signal, capture: true });
    element.addEventListener("pointercancel", up, { signal, capture: true });
    element.addEventListener("pointerleave", () => {
      cancelAnimationFrame(asked);
      now.pointed.value = null;
    }, { signal });
    element.addEventListener("wheel", (event) => {
      if (!isMap()) return;
      event.preventDefault();
      event.stopPropagation();
      eyeing.zoomMap(Math.exp(-event.deltaY * WHEEL_LOG), place(event));
    }, { signal, capture: true, passive: false });
    return () => {
      cancelAnimationFrame(asked);
      ending.abort();
    };
  }, []);
}

/** Enter takes the place in the middle; arrows move the map beneath it. */
function onKey(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey || (event.target as Element).closest("button")) return;
  const middle = eyeing.screen.value && ([eyeing.screen.value[0] / 2, eyeing.screen.value[1] / 2] as const);
  const [dx, dy] = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [];
  if (event.key === "Enter" && middle && now.how.value === "pairs") {
    const to = meant(middle);
    if (to) edits.offerPlace(to.place);
  } else if (event.key === "Escape" && now.half.value) now.half.value = null;
  else if (eyeing.sight.value !== "map") return;
  else if (dx !== undefined && dy !== undefined) {
    const by = PAN_PX[event.shiftKey ? 1 : 0];
    eyeing.panMap([dx * by, dy * by]);
  } else if (event.key === "+" || event.key === "=") eyeing.zoomMap(ZOOM_STEP);
  else if (event.key === "-") eyeing.zoomMap(1 / ZOOM_STEP);
  else if (event.key === "0") eyeing.reset();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

export function ScenePane() {
  const host = useRef<HTMLDivElement>(null);
  const stage = useSignal<Stage | null>(null);
  const opacity = useSignal(1);
  const withOthers = useSignal(false);
  useProjection(stage, opacity, withOthers);
  usePointers(host);
  useEffect(() => {
    const element = host.current;
    if (!element) return undefined;
    const sizes = new ResizeObserver(() => (eyeing.screen.value = [element.clientWidth, element.clientHeight]));
    sizes.observe(element);
    // Before the viewport's own keys, which turn it.
    element.addEventListener("keydown", onKey, { capture: true });
    return () => {
      sizes.disconnect();
      element.removeEventListener("keydown", onKey, { capture: true });
    };
  }, []);
  return (
    <section class="cal-pane" aria-label={say("cameras.scene")}>
      <div class="cal-tools">
        <Segments name="cal-sight" label={say("cameras.sight")} values={eyeing.SIGHTS} chosen={eyeing.sight.value} text={(value) => say(`cameras.sight.${value}`)}
          onChoose={(value) => (eyeing.sight.value = value)} />
        <button type="button" disabled={!now.lens.value} onClick={eyeing.lookThrough}>{say("cameras.sight.through")}</button>
        <button type="button" onClick={eyeing.reset}>{say("cameras.sight.reset")}</button>
        <label class="cal-check">
          <input type="checkbox" checked={withOthers.value} onChange={(event) => (withOthers.value = event.currentTarget.checked)} /> {say("cameras.sight.others")}
        </label>
        <label class="cal-range push">{say("cameras.sight.opacity")}
          <input type="range" min="0" max="1" step="0.05" value={opacity.value} onInput={(event) => (opacity.value = Number(event.currentTarget.value))} />
        </label>
      </div>
      <div ref={host} class={`cal-stage is-scene is-${now.how.value}`} data-view={JSON.stringify(eyeing.view.value)}>
        <Viewport class="cal-viewport" label={say("cameras.scene.label")} describedBy="cal-scene-help" surfaces={surfaces.value} view={eyeing.view.value}
          onView={eyeing.look} onReset={eyeing.reset} onStage={(made) => {
            stage.value = made;
            return () => {
              stage.value = null;
            };
          }}>
          <SceneOverlay />
          <svg class="cal-middle" width="40" height="40" viewBox="-20 -20 40 40" aria-hidden="true"><path class="cal-crosshair" d="M-20 0h15m10 0h15M0-20v15m0 10v15" /></svg>
          <Places />
          <Handles />
        </Viewport>
      </div>
      <p id="cal-scene-help" class="quiet cal-help">{say(`cameras.scene.help.${now.how.value}`)}</p>
    </section>
  );
}
