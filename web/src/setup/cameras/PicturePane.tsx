// The camera's own picture: looked at closely, clicked to the pixel, by pointer and by keys.

import { type Signal, useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { dependOn } from "../../depend";
import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { type DraftCamera, settle } from "../draft";
import { NumberField } from "../Fields";
import { AXES, axis, begun as lineBegun } from "./drawing";
import * as edits from "./edits";
import { type Frame, type Pane, SQUARES_FROM, resolved, showing as within, zoomed } from "./frame";
import { follow as followPointers } from "./gestures";
import { keyed } from "./holding";
import { Magnifier } from "./Magnifier";
import * as now from "./now";
import { Overlay } from "./Overlay";
import { type Pixel, sight } from "./pairs";
import * as pictures from "./pictures";
import { met } from "./scene";

type Grip = { kind: "pair"; idx: number } | { kind: "half" } | { kind: "line"; idx: number; end: 0 | 1 };

const STEP = { fine: 1, coarse: 10 } as const;
const ZOOM_STEP = 1.5;
const LEAST_LINE_PX = 6;
const ARROWS: Readonly<Record<string, Pixel>> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Tells where the pointer is, and what the picture shows there. */
export function hover(at: Pixel | null): void {
  const lens = now.lens.value;
  const through = at && lens ? sight(lens, at) : null;
  const found = through && met(through);
  now.hovered.value = at && { pixel: at, place: found?.place ?? null, thing: found?.thing ?? null };
}

/** A click, or Enter at the crosshair. */
function place(at: Pixel): void {
  if (now.how.value === "pairs") edits.offerPixel(at);
  else if (now.how.value === "lines") drawTo(at);
}

function drawTo(at: Pixel): void {
  const from = lineBegun.value;
  if (!from) {
    lineBegun.value = at;
    return;
  }
  lineBegun.value = null;
  if (Math.hypot(at[0] - from[0], at[1] - from[1]) >= LEAST_LINE_PX) edits.addLine({ axis: axis.value, ends_px: [from, at] });
}

function grips(): { grip: Grip; at: Pixel }[] {
  if (now.how.value === "lines") {
    return now.lines.value.flatMap(({ ends_px }, idx) => ends_px.map((at, end) => ({ grip: { kind: "line" as const, idx, end: end === 0 ? 0 as const : 1 as const }, at })));
  }
  if (now.how.value !== "pairs") return [];
  const waiting = now.half.value?.picture_px;
  const all = now.pairs.value.map(({ picture_px }, idx) => ({ grip: { kind: "pair" as const, idx }, at: picture_px }));
  return waiting ? [...all, { grip: { kind: "half" as const }, at: waiting }] : all;
}

function moveGrip(grip: Grip, to: Pixel, key: string): void {
  if (grip.kind === "pair") edits.movePair(grip.idx, { picture_px: to }, key);
  else if (grip.kind === "line") edits.moveLineEnd(grip.idx, grip.end, to, key);
  else now.half.value = { picture_px: to };
}

function usePicture(camera: DraftCamera): void {
  const key = useComputed(() => {
    const of = now.chosen.value;
    return of && JSON.stringify([of.id, of.source, now.isRunning(of), pictures.showing.value, pictures.lookAt.value]);
  });
  useEffect(() => pictures.follow(camera), [key.value]);
}

function Tools({ frame, pane }: { frame: Signal<Frame>; pane: Pane | null }) {
  const camera = now.chosen.value;
  const by = (factor: number) => {
    if (pane) frame.value = zoomed(frame.value, pane, factor);
  };
  return (
    <div class="cal-tools">
      {camera && now.isRunning(camera) && (
        <Segments name="cal-showing" label={say("cameras.showing")} values={pictures.SHOWINGS} chosen={pictures.showing.value}
          text={(value) => say(`cameras.showing.${value}`)} onChoose={(value) => (pictures.showing.value = value)} />
      )}
      {camera && !now.isRunning(camera) && pictures.lookLength.value !== null && (
        <NumberField label={say("cameras.lookAt")} unit="s" min={0} max={pictures.lookLength.value} value={pictures.lookAt.value}
          onChange={(value) => (pictures.lookAt.value = value ?? 0)} />
      )}
      {now.how.value === "lines" && (
        <Segments name="cal-axis" label={say("cameras.lines.axis")} values={AXES} chosen={axis.value} text={(name) => say(`cameras.axis.${name}`)} onChoose={(name) => (axis.value = name)} />
      )}
      <span class="push pair">
        <button type="button" onClick={() => by(1 / ZOOM_STEP)} aria-label={say("cameras.zoom.out")} title={say("cameras.zoom.out")}>−</button>
        <button type="button" onClick={() => by(ZOOM_STEP)} aria-label={say("cameras.zoom.in")} title={say("cameras.zoom.in")}>+</button>
        <button type="button" onClick={() => (frame.value = null)} title={say("cameras.zoom.whole.title")}>{say("cameras.zoom.whole")}</button>
        {pane && <output class="cal-zoom">{`${Math.round(resolved(frame.value, pane).scale * 100)} %`}</output>}
      </span>
    </div>
  );
}

function Check({ of, text }: { of: Signal<boolean>; text: string }) {
  return (
    <label class="cal-check">
      <input type="checkbox" checked={of.value} onChange={(event) => (of.value = event.currentTarget.checked)} /> {text}
    </label>
  );
}

/** What keys do in the picture; false where they mean nothing here. */
function useKeys(frame: Signal<Frame>, cross: Signal<Pixel | null>, pane: () => Pane | null) {
  return (event: KeyboardEvent): void => {
    const of = pane();
    if (!of || event.ctrlKey || event.metaKey || event.altKey || event.target !== event.currentTarget) return;
    const held = now.how.value === "torch" && now.shown.value ? keyed(now.shown.value, event.key, event.shiftKey) : null;
    if (held) {
      event.preventDefault();
      edits.hold(held, "cameras:keys");
      return;
    }
    const arrow = ARROWS[event.key];
    const at: Pixel = cross.value ?? centre(resolved(frame.value, of).at, of);
    if (arrow) {
      const by = event.shiftKey ? STEP.coarse : STEP.fine;
      const clamp = (value: number, most: number) => Math.min(Math.max(value, 0.5), most - 0.5);
      const next: Pixel = cross.value ? [clamp(at[0] + arrow[0] * by, of.picture[0]), clamp(at[1] + arrow[1] * by, of.picture[1])] : at;
      cross.value = next;
      frame.value = within(frame.value, of, next);
      hover(next);
    } else if (event.key === "Enter" || event.key === " ") {
      cross.value ??= at;
      place(at);
    } else if (event.key === "+" || event.key === "=") frame.value = zoomed(frame.value, of, ZOOM_STEP, undefined);
    else if (event.key === "-") frame.value = zoomed(frame.value, of, 1 / ZOOM_STEP);
    else if (event.key === "0") frame.value = null;
    else if ((event.key === "Delete" || event.key === "Backspace") && now.how.value === "pairs" && now.selected.value !== null) edits.removePair(now.selected.value);
    else if (event.key === "Escape" && (now.half.value || lineBegun.value || cross.value)) {
      if (now.half.value || lineBegun.value) [now.half.value, lineBegun.value] = [null, null];
      else cross.value = null;
    }
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
}

/** The middle of the pixel that a point lies in. */
const centre = ([x, y]: Pixel, { picture: [width, height] }: Pane): Pixel =>
  [Math.min(Math.floor(x), width - 1) + 0.5, Math.min(Math.floor(y), height - 1) + 0.5];

/** What the pane says to who cannot see it, and over the picture to who can. */
function Told({ cross }: { cross: Pixel | null }) {
  const at = now.hovered.value;
  if (!at) return null;
  const [x, y] = at.pixel;
  const pixel = say("cameras.at.pixel", { x: x.toFixed(1), y: y.toFixed(1) });
  const place = at.place && say("cameras.at.place", { place: at.place.map((metres) => metres.toFixed(2)).join(", "), thing: at.thing ?? "" });
  const text = place ? `${pixel} · ${place}` : now.lens.value ? `${pixel} · ${say("cameras.at.nothing")}` : pixel;
  return <p class="cal-told" role={cross ? "status" : undefined}>{text}</p>;
}

const nameOf = (camera: DraftCamera) => camera.name || camera.id;

export function PicturePane({ camera }: { camera: DraftCamera }) {
  const host = useRef<HTMLDivElement>(null);
  const screen = useSignal<Pixel | null>(null);
  const frame = useSignal<Frame>(null);
  const cross = useSignal<Pixel | null>(null);
  const touch = useSignal(false);
  usePicture(camera);

  const paneOf = (): Pane | null => {
    const [picture, on] = [now.size.value, screen.value];
    return picture && on && on[0] > 0 ? { picture, screen: on } : null;
  };
  const id = useComputed(() => now.chosen.value?.id);
  useSignalEffect(() => {
    dependOn(id);
    [frame.value, cross.value, now.hovered.value] = [null, null, null];
  });

  useEffect(() => {
    const element = host.current;
    if (!element) return undefined;
    const sizes = new ResizeObserver(() => (screen.value = [element.clientWidth, element.clientHeight]));
    sizes.observe(element);
    let key = "";
    const stop = followPointers<Grip>(element, {
      frame,
      pane: paneOf,
      grips: {
        all: grips,
        take: (grip) => {
          key = edits.begun();
          if (grip.kind === "pair") now.selected.value = grip.idx;
        },
        move: (grip, to) => moveGrip(grip, to, key),
        drop: settle,
      },
      click: (at) => {
        cross.value = null;
        place(at);
      },
      hover: (at, isTouch) => {
        touch.value = isTouch;
        if (at || !cross.value) hover(at ?? cross.value);
      },
      draw: () => (now.how.value === "lines" ? { begin: (from) => (lineBegun.value = from), end: (_, to) => drawTo(to) } : null),
    });
    return () => {
      sizes.disconnect();
      stop();
      now.hovered.value = null;
    };
  }, []);

  const onKey = useKeys(frame, cross, paneOf);
  const pane = paneOf();
  const shown = pictures.picture.value;
  const isOwn = shown !== null && shown.camera === camera.id;
  const glass = now.hovered.value?.pixel ?? null;
  const { at, scale } = pane ? resolved(frame.value, pane) : { at: [0, 0] as Pixel, scale: 1 };
  return (
    <section class="cal-pane" aria-label={say("cameras.picture")}>
      <Tools frame={frame} pane={pane} />
      {/* eslint-disable-next-line jsx-a11y/no-noninteractive-element-interactions -- an application takes keys and pointers by itself */}
      <div ref={host} class={`cal-stage is-${now.how.value}`} role="application"
        // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- an application takes keys
        tabIndex={0}
        onKeyDown={onKey} onBlur={() => (cross.value = null)}
        aria-label={say("cameras.picture.label", { camera: nameOf(camera) })} aria-describedby="cal-picture-help"
        data-scale={scale} data-left={pane ? pane.screen[0] / 2 - at[0] * scale : 0} data-top={pane ? pane.screen[1] / 2 - at[1] * scale : 0}>
        {isOwn && pane && (
          <img class={`cal-picture${scale >= SQUARES_FROM ? " has-squares" : ""}`} alt={say("cameras.picture.alt", { camera: nameOf(camera) })} src={shown.url}
            style={{
              width: `${pane.picture[0]}px`, height: `${pane.picture[1]}px`,
              transform: `translate(${pane.screen[0] / 2 - at[0] * scale}px, ${pane.screen[1] / 2 - at[1] * scale}px) scale(${scale})`,
            }} />
        )}
        {pane && <Overlay frame={frame.value} pane={pane} cross={cross.value} />}
        {isOwn && pane && glass && ["pairs", "lines"].includes(now.how.value) && <Magnifier url={shown.url} frame={frame.value} pane={pane} at={glass} isTouch={touch.value} />}
        {!isOwn && <p class="cal-none">{pictures.trouble.value ?? say("cameras.picture.none")}</p>}
        {isOwn && pictures.trouble.value !== null && <p class="cal-veil" role="status">{pictures.trouble.value}</p>}
        <Told cross={cross.value} />
      </div>
      <div class="cal-below">
        <div class="cal-checks">
          <Check of={now.showsGrid} text={say("cameras.show.grid")} />
          <Check of={now.showsOutline} text={say("cameras.show.edges")} />
          <Check of={now.isEnlarged} text={say("cameras.show.enlarged")} />
        </div>
        <p id="cal-picture-help" class="quiet cal-help">{say(`cameras.picture.help.${now.how.value}`)}</p>
      </div>
    </section>
  );
}

