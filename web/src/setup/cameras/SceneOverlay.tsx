// What lies over the scene: pairs with their numbers, the camera with what it sees, other cameras, and what the pointer means.

import { useRef } from "preact/hooks";
import type { Point } from "../../operate/orbit";
import { footprint, lensOf, ray } from "../../spatial/lens";
import { say } from "../../strings";
import { calibrationOf, draft, settle } from "../draft";
import type { Eye } from "../geometry/eye";
import * as edits from "./edits";
import { eye } from "./eyeing";
import { meant } from "./meaning";
import * as now from "./now";
import { Marker } from "./Overlay";
import { type Pixel, color } from "./pairs";
import { snapName } from "./PairsPanel";
import { document } from "./scene";
import { add, aim, extent, point } from "./torch";

const NUDGE_M = [0.05, 0.5] as const;
/** How far a camera's sight is drawn, times the ground's size. */
const SIGHT_SHARE = 1.5;

const path = (view: Eye, places: readonly Point[], isClosed: boolean) =>
  view.lines(places, isClosed).map((piece) => `M${piece.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`).join("");

/** The camera, its pole, and what of the ground it sees. */
function Frustum({ view }: { view: Eye }) {
  const [of, lens] = [now.shown.value, now.lens.value];
  if (!of || !lens) return null;
  const { low, high, level_m } = extent(document.value);
  const far = SIGHT_SHARE * Math.max(high[0] - low[0], high[1] - low[1]);
  const [x, y, z] = point(of.position_m);
  const seen = footprint(lens, level_m, far);
  const corners = ([[0, 0], [1, 0], [1, 1], [0, 1]] as const).flatMap((at) => {
    const through = ray(lens, at);
    return through ? [add(through.origin, through.direction, Math.min(3, far / 10))] : [];
  });
  return (
    <g class="cal-frustum">
      <path class="cal-seen" d={path(view, seen, true)} />
      <path d={path(view, [[x, y, z], [x, y, level_m]], false)} />
      <path d={path(view, [[x, y, z], aim(of, level_m)], false)} class="cal-axis" />
      <path d={path(view, corners, true)} />
      {corners.map((corner, i) => <path key={i} d={path(view, [[x, y, z], corner], false)} />)}
    </g>
  );
}

function Others({ view }: { view: Eye }) {
  const of = draft.value;
  return (
    <>
      {of?.cameras.map(({ id, name }) => {
        const calibration = id === now.chosen.value?.id ? null : calibrationOf(of, id);
        const at = calibration && view.place(point(calibration.position_m));
        const ahead = calibration && view.place(add(point(calibration.position_m), lensOf(calibration).axes[2], 2));
        return at && (
          <g key={id} class="cal-other">
            {ahead && <path d={`M${at[0]} ${at[1]}L${ahead[0]} ${ahead[1]}`} />}
            <circle cx={at[0]} cy={at[1]} r={4} />
            <text x={at[0] + 8} y={at[1] + 4}>{name || id}</text>
          </g>
        );
      })}
    </>
  );
}

function Pointed({ view }: { view: Eye }) {
  const to = now.pointed.value;
  const at = to && view.place(to.place);
  if (!at) return null;
  const name = to.snap ? snapName(to.snap) : "";
  const text = say("cameras.at.world", { place: to.place.map((metres) => metres.toFixed(2)).join(", ") });
  return (
    <g class={`cal-pointed${to.snap ? " is-snapped" : ""}`}>
      {to.snap ? <rect x={at[0] - 7} y={at[1] - 7} width={14} height={14} /> : <circle cx={at[0]} cy={at[1]} r={5} />}
      <text x={at[0] + 12} y={at[1] + 22}>{name ? `${name} · ${text}` : text}</text>
    </g>
  );
}

/** Where the place lies that the picture's pointer shows. */
function Hovered({ view }: { view: Eye }) {
  const place = now.hovered.value?.place;
  const at = place && view.place(place);
  return at ? <path class="cal-crosshair" d={`M${at[0] - 12} ${at[1]}h8m8 0h8M${at[0]} ${at[1] - 12}v8m0 8v8`} /> : null;
}

export function SceneOverlay() {
  const view = eye.value;
  if (!view) return null;
  const waiting = now.half.value?.place_m;
  const waits = waiting && view.place(waiting);
  const n = now.pairs.value.length;
  return (
    <svg class="cal-overlay" width={view.size_px[0]} height={view.size_px[1]} aria-hidden="true">
      <Frustum view={view} />
      <Others view={view} />
      <Hovered view={view} />
      {waits && <Marker at={waits} text={String(n + 1)} fill={color(n)} isChosen isOpen />}
      {now.how.value === "pairs" && <Pointed view={view} />}
    </svg>
  );
}

/** A pair's place, to be dragged and moved by keys. */
function Place({ idx, place, at }: { idx: number; place: Point; at: Pixel }) {
  const isChosen = now.selected.value === idx;
  const isWorst = now.fitted.value?.worst === idx;
  const key = useRef("");
  const down = (event: PointerEvent) => {
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    key.current = edits.begun();
    now.selected.value = idx;
  };
  const move = (event: PointerEvent) => {
    const button = event.currentTarget as Element;
    const box = button.parentElement?.getBoundingClientRect();
    if (!box || !button.hasPointerCapture(event.pointerId)) return;
    const to = meant([event.clientX - box.left, event.clientY - box.top], event.altKey);
    now.pointed.value = to;
    if (to) edits.movePair(idx, { place_m: to.place }, key.current);
  };
  const up = () => {
    now.pointed.value = null;
    settle();
  };
  const press = (event: KeyboardEvent) => {
    const by = NUDGE_M[event.shiftKey ? 1 : 0];
    const [dx, dy, dz] = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1] }[event.key] ?? [];
    if (event.key === "Delete" || event.key === "Backspace") edits.removePair(idx);
    else if (dx !== undefined && dy !== undefined && dz !== undefined) edits.movePair(idx, { place_m: add(place, [dx * by, dy * by, dz * by]) }, `cameras:nudge:${idx}`);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <button type="button" class="cal-place" style={{ left: `${at[0]}px`, top: `${at[1]}px` }} aria-label={say("cameras.pair.inScene", { n: idx + 1, place: place.map((m) => m.toFixed(2)).join(", ") })}
      onPointerDown={down} onPointerMove={move} onPointerUp={up} onPointerCancel={up} onKeyDown={press} onFocus={() => (now.selected.value = idx)}>
      <svg width={60} height={40} viewBox="-20 -20 60 40" aria-hidden="true"><Marker at={[0, 0]} text={String(idx + 1)} fill={color(idx)} isChosen={isChosen} isWorst={isWorst} /></svg>
    </button>
  );
}

export function Places() {
  const view = eye.value;
  if (!view || now.how.value !== "pairs") return null;
  return <>{now.pairs.value.map(({ place_m }, idx) => {
    const at = view.place(place_m);
    return at && <Place key={idx} idx={idx} place={place_m} at={at} />;
  })}</>;
}
