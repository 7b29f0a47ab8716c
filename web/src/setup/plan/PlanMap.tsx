// A map from above, for stages that draw on it: it is moved and enlarged here, with grid, north and scale; what it shows beside the
// ground is the stage's (children: SVG in pixels; `under`: what lies beneath the lines, such as pictures).

import "./plan.css";
import type { ComponentChildren, RefObject } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { say } from "../../strings";
import type { SceneDocument } from "../draft";
import { type Corner, type Frame, gridLines, panned, roundStep, toScreen, zoomed } from "./frame";
import { type Handlers, attachPress } from "./press";

type Given = {
  label: string;
  frame: Frame;
  onFrame: (change: (frame: Frame) => Frame) => void;
  /** What pointers do beside moving the map. */
  handlers: Omit<Handlers, "travel" | "zoom">;
  /** Ground, drawn beneath all else. */
  document?: SceneDocument;
  /** Ground is drawn as lines alone, since what lies under it shows it already. */
  isGroundClear?: boolean;
  gridStep?: number;
  under?: ComponentChildren;
  children?: ComponentChildren;
  /** Further elements over the map: fields, buttons. */
  over?: ComponentChildren;
  cursor?: string;
  onKeyDown?: (event: KeyboardEvent) => void;
  stageRef?: RefObject<HTMLDivElement>;
};

/** The `points` of an SVG polygon. */
export function pointsOf(frame: Frame, places: readonly (readonly number[])[]): string {
  return places.map(([x = 0, y = 0]) => toScreen(frame, [x, y]).map((px) => px.toFixed(1)).join(",")).join(" ");
}

function Grid({ frame, step }: { frame: Frame; step: number }) {
  const [width, height] = frame.size_px;
  return (
    <g class="plan-grid" aria-hidden="true">
      {gridLines(frame, 0, step).map((x) => {
        const [px] = toScreen(frame, [x, 0]);
        return <line key={`x${x}`} class={Math.abs(x) < 1e-9 ? "is-axis" : undefined} x1={px} x2={px} y1={0} y2={height} />;
      })}
      {gridLines(frame, 1, step).map((y) => {
        const [, py] = toScreen(frame, [0, y]);
        return <line key={`y${y}`} class={Math.abs(y) < 1e-9 ? "is-axis" : undefined} x1={0} x2={width} y1={py} y2={py} />;
      })}
    </g>
  );
}

function Ground({ frame, document, isClear }: { frame: Frame; document: SceneDocument; isClear: boolean }) {
  const fields = (document.height_fields ?? []).map(({ low_m: [x = 0, y = 0], step_m, columns, heights_m, color_srgb }) => {
    const [east, north] = [x + (columns - 1) * step_m, y + (Math.floor(heights_m.length / columns) - 1) * step_m];
    return { outline: [[x, y], [east, y], [east, north], [x, north]], color: color_srgb };
  });
  const grounds = (document.ground ?? []).map(({ polygon, color_srgb, imagery }) => ({
    // What lies under the lines shows through.
    outline: polygon, color: imagery ? "transparent" : color_srgb,
  }));
  return (
    <g class="plan-ground" aria-hidden="true">
      {[...grounds, ...fields].map(({ outline, color }, i) => (
        <polygon key={i} points={pointsOf(frame, outline)} style={{ fill: isClear ? "transparent" : (color ?? "#8a8a84") }} />
      ))}
    </g>
  );
}

/** A bar of a round length. */
function Scale({ frame }: { frame: Frame }) {
  const metres = roundStep(60 / frame.scale);
  return (
    <div class="plan-scale" aria-hidden="true">
      <span class="plan-north">{say("plan.north")}</span>
      <span class="plan-bar" style={{ width: `${metres * frame.scale}px` }} />
      <span>{say("plan.metres", { n: Number(metres.toPrecision(2)) })}</span>
    </div>
  );
}

export function PlanMap({ label, frame, onFrame, handlers, document: of, isGroundClear = false, gridStep = 0, under, children, over, cursor, onKeyDown, stageRef }: Given) {
  const own = useRef<HTMLDivElement>(null);
  const stage = stageRef ?? own;
  const latest = useRef<Handlers | null>(null);
  latest.current = {
    ...handlers,
    travel: (by) => onFrame((before) => panned(before, by)),
    zoom: (factor, at) => onFrame((before) => zoomed(before, factor, at)),
  };
  const resize = useRef(onFrame);
  resize.current = onFrame;
  useEffect(() => {
    const element = stage.current;
    if (!element) return undefined;
    const measure = () => {
      const size: Corner = [element.clientWidth, element.clientHeight];
      if (size[0] > 0) resize.current((before) => (before.size_px[0] === size[0] && before.size_px[1] === size[1] ? before : { ...before, size_px: size }));
    };
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    measure();
    const detach = attachPress(element, () => latest.current as Handlers);
    return () => {
      observer.disconnect();
      detach();
    };
  }, [stage]);
  const onKey = (event: KeyboardEvent) => {
    const middle: Corner = [frame.size_px[0] / 2, frame.size_px[1] / 2];
    const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
    if (factor === undefined || event.ctrlKey || event.metaKey || event.altKey || event.target !== stage.current) {
      onKeyDown?.(event);
      return;
    }
    event.preventDefault();
    onFrame((before) => zoomed(before, factor, middle));
  };
  return (
    // eslint-disable-next-line jsx-a11y/no-noninteractive-element-interactions, jsx-a11y/no-noninteractive-tabindex -- an application takes keys and pointers by itself
    <div ref={stage} class="plan" role="application" aria-label={label} tabIndex={0} style={{ cursor: cursor ?? "grab" }} onKeyDown={onKey}>
      {under}
      <svg width={frame.size_px[0]} height={frame.size_px[1]} aria-hidden="true">
        {of && <Ground frame={frame} document={of} isClear={isGroundClear} />}
        <Grid frame={frame} step={gridStep} />
        {children}
      </svg>
      <Scale frame={frame} />
      {over}
    </div>
  );
}
