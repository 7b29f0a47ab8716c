// The timeline as it is drawn, on a canvas, since hours of activity are thousands of bars; and what pointer, wheel and keys do to it.

import { signal } from "@preact/signals";
import * as clockwork from "./clockwork";
import * as state from "./state";
import { label, shifted, ticks, zoomed } from "./timescale";

/** Wheel and drag: what a pixel means. */
const ZOOM_PER_PIXEL = 0.002;
const CLICK_PIXELS = 4;
/** Where time begins, beside the cameras' names: a share of the width, and at most so many times the text's height. */
const GUTTER_SHARE = 0.28;
const GUTTER_LINES = 11;
const EVENT_PIXELS = 8;

/** Where the pointer rests over the timeline: the time there, the camera whose row it is, and the column. */
export type Hovered = { readonly millis: number; readonly camera: string | null; readonly x: number; readonly event: string | null };
export const hovered = signal<Hovered | null>(null);

/** Height of the timeline's text, pixels: large screens stand farther away. */
function textHeight(): number {
  return 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
}

/** Columns beside which time begins. */
export function gutter(width: number): number {
  return Math.min(width * GUTTER_SHARE, textHeight() * GUTTER_LINES);
}

const TOP_LINES = 1.6;

/** The camera's row at a height of the canvas. */
function rowAt(canvas: HTMLCanvasElement, y: number): string | null {
  const rows = clockwork.rows();
  const top = textHeight() * TOP_LINES;
  const each = (canvas.clientHeight - top - EVENT_PIXELS) / Math.max(rows.length, 1);
  return rows[Math.floor((y - top) / each)]?.camera ?? null;
}

export function draw(canvas: HTMLCanvasElement): void {
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
  const { from, to } = clockwork.stretch.value;
  const [text, left] = [textHeight(), gutter(width)];
  const x = (millis: number) => left + ((millis - from) / (to - from)) * (width - left);
  const { at, step } = ticks(clockwork.stretch.value, (width - left) / (text * 8));
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
  const rows = clockwork.rows();
  const top = text * TOP_LINES;
  const each = (height - top - EVENT_PIXELS) / Math.max(rows.length, 1);
  const tall = Math.max(each - 3, 2);
  const opened = state.openedCamera.value;
  rows.forEach(({ camera, ranges, activity }, i) => {
    const y = top + i * each;
    context.globalAlpha = opened === undefined || opened === camera ? 1 : 0.45;
    context.fillStyle = color("bar");
    for (const [start, end] of ranges) context.fillRect(x(start), y, Math.max(x(end) - x(start), 1), tall);
    context.fillStyle = color("accent");
    for (const { at: start, share } of activity) {
      // A share of a hundredth of the picture is much already.
      const part = Math.min(1, Math.sqrt(share * 50)) * tall;
      const [begin, end] = [x(start), x(start + (clockwork.told.value?.stepMillis ?? 0))];
      context.fillRect(begin, y + tall - part, Math.max(end - begin - 1, 1), Math.max(part, share > 0 ? 1 : 0));
    }
  });
  context.globalAlpha = 1;
  context.fillStyle = color("wait");
  for (const { at: when } of clockwork.told.value?.events ?? []) context.fillRect(x(when) - 1, height - EVENT_PIXELS, 3, EVENT_PIXELS);
  drawRange(context, x, height, color("accent"));
  context.fillStyle = color("bad");
  context.fillRect(Math.round(x(clockwork.shownTime())) - 1, 0, 2, height);
  context.restore();
  if (tall < text) return;
  context.textBaseline = "middle";
  context.fillStyle = color("ink");
  rows.forEach(({ camera }, i) => context.fillText(state.nameOf(camera), 4, top + i * each + tall / 2, left - 10));
}

function drawRange(context: CanvasRenderingContext2D, x: (millis: number) => number, height: number, color: string): void {
  const range = clockwork.range.value;
  if (!range) return;
  context.globalAlpha = 0.25;
  context.fillStyle = color;
  context.fillRect(x(range.from), 0, x(range.to) - x(range.from), height);
  context.globalAlpha = 1;
}

const zoom = (factor: number) => {
  clockwork.stretch.value = zoomed(clockwork.stretch.peek(), clockwork.shownTime(), factor);
};

const KEYS: Record<string, (shift: boolean) => void> = {
  ArrowLeft: (shift) => (shift ? clockwork.skip(-10e3) : void clockwork.step(-1)),
  ArrowRight: (shift) => (shift ? clockwork.skip(10e3) : void clockwork.step(1)),
  PageDown: () => clockwork.skip(-60e3),
  PageUp: () => clockwork.skip(60e3),
  End: clockwork.goLive,
  "+": () => zoom(0.7),
  "=": () => zoom(0.7),
  "-": () => zoom(1 / 0.7),
  " ": () => (clockwork.playing.peek() === null ? clockwork.togglePlay(1) : clockwork.pause()),
};

/** Listens to pointer, wheel and keys until the answered function is called. */
export function listen(canvas: HTMLCanvasElement): () => void {
  const ending = new AbortController();
  const { signal: ended } = ending;
  const millisAt = (clientX: number) => {
    const box = canvas.getBoundingClientRect();
    const { from, to } = clockwork.stretch.peek();
    const left = gutter(box.width);
    return from + (Math.max(clientX - box.left - left, 0) / (box.width - left)) * (to - from);
  };
  const perPixel = () => {
    const { from, to } = clockwork.stretch.peek();
    return (to - from) / (canvas.clientWidth - gutter(canvas.clientWidth));
  };
  const hover = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    if (x < gutter(box.width) || event.pointerType === "touch") return void (hovered.value = null);
    const millis = millisAt(event.clientX);
    const near = clockwork.told.peek()?.events.find(({ at }) => Math.abs(at - millis) < perPixel() * 4);
    hovered.value = { millis, camera: rowAt(canvas, y), x, event: near ? `${state.nameOf(near.camera)}: ${near.text}` : null };
  };
  let grabbed: { x: number; moved: number } | null = null;
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30;
    const stretch = clockwork.stretch.peek();
    clockwork.stretch.value = Math.abs(event.deltaX) > Math.abs(event.deltaY)
      ? shifted(stretch, event.deltaX * unit * perPixel())
      : zoomed(stretch, millisAt(event.clientX), Math.exp(event.deltaY * unit * ZOOM_PER_PIXEL));
  }, { signal: ended, passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    grabbed = { x: event.clientX, moved: 0 };
  }, { signal: ended });
  canvas.addEventListener("pointermove", (event) => {
    if (!grabbed) {
      hover(event);
      return;
    }
    const by = event.clientX - grabbed.x;
    grabbed = { x: event.clientX, moved: grabbed.moved + Math.abs(by) };
    if (grabbed.moved > CLICK_PIXELS) clockwork.stretch.value = shifted(clockwork.stretch.peek(), -by * perPixel());
  }, { signal: ended });
  canvas.addEventListener("pointerup", (event) => {
    if (grabbed && grabbed.moved <= CLICK_PIXELS && event.clientX - canvas.getBoundingClientRect().left >= gutter(canvas.clientWidth)) {
      clockwork.goTo(millisAt(event.clientX));
    }
    grabbed = null;
  }, { signal: ended });
  canvas.addEventListener("pointercancel", () => (grabbed = null), { signal: ended });
  canvas.addEventListener("pointerleave", () => (hovered.value = null), { signal: ended });
  canvas.addEventListener("keydown", (event) => {
    const key = KEYS[event.key];
    if (!key || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    key(event.shiftKey);
  }, { signal: ended });
  return () => {
    ending.abort();
    hovered.value = null;
  };
}
