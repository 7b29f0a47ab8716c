// The ground from above: outlines whose corners are dragged, the picture beneath, and where calibrated cameras stand.

import { useRef } from "preact/hooks";
import { say } from "../../strings";
import { calibrationOf, draft, isReadOnly, settle } from "../draft";
import { type Corner, type Frame, fitted, toScreen, toWorld } from "../plan/frame";
import { PlanMap, pointsOf } from "../plan/PlanMap";
import type { Drag } from "../plan/press";
import { GroundPicture } from "./GroundPicture";
import { movedImagery } from "./placement";
import { corner, isInside, rounded, withCorner, withCornerAfter, withoutCorner } from "./polygon";
import { type Ground, addGround, drawn, editGround, editImagery, line, take, tool, turnNorth } from "./tools";

const REACH_PX = 12;
const NUDGE_M = 0.1;
const FAR_NUDGE_M = 1;
const CONE_PX = 34;

const apart = (a: Corner, b: Corner) => Math.hypot(a[0] - b[0], a[1] - b[1]);
const middle = (a: Corner, b: Corner): Corner => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];

/** Corners of other outlines draw those that come near, so that grounds meet without a gap. */
function snapped(place: Corner, frame: Frame, grounds: readonly Ground[], idx: number): Corner {
  const others = grounds.flatMap(({ polygon }, i) => (i === idx ? [] : polygon.map(corner)));
  const near = others.filter((other) => apart(toScreen(frame, other), toScreen(frame, place)) < REACH_PX / 1.5);
  return near[0] ?? place;
}

function Cameras({ frame }: { frame: Frame }) {
  const of = draft.value;
  if (!of) return null;
  return (
    <g class="ground-cameras">
      {of.cameras.map(({ id, name }) => {
        const calibration = calibrationOf(of, id);
        if (!calibration) return null;
        const [x = 0, y = 0] = calibration.position_m;
        const [qx = 0, qy = 0, qz = 0, qw = 1] = calibration.world_from_camera;
        const ahead: Corner = [2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx)];
        const length = Math.hypot(...ahead) || 1;
        const [px, py] = toScreen(frame, [x, y]);
        return (
          <g key={id} transform={`translate(${px} ${py})`}>
            <line x1="0" y1="0" x2={(ahead[0] / length) * CONE_PX} y2={(-ahead[1] / length) * CONE_PX} />
            <circle r="6" />
            <text x="9" y="-7">{name || id}</text>
          </g>
        );
      })}
    </g>
  );
}

function Outlines({ frame, grounds, chosen }: { frame: Frame; grounds: readonly Ground[]; chosen: number }) {
  const corners = drawn.value;
  const last = line.value;
  return (
    <>
      <g class="ground-outlines">
        {grounds.map(({ polygon, color_srgb, imagery }, i) => (
          <polygon key={i} class={i === chosen ? "is-chosen" : undefined} points={pointsOf(frame, polygon)}
            style={{ fill: imagery ? "transparent" : (color_srgb ?? "#8a8a84"), fillOpacity: 0.75 }} />
        ))}
      </g>
      {corners.length > 0 && <polyline class="ground-drawn" points={pointsOf(frame, corners)} />}
      {corners.map((place, i) => {
        const [px, py] = toScreen(frame, place);
        return <circle key={i} class="ground-drawn" cx={px} cy={py} r={5} />;
      })}
      {last && <line class="ground-line" {...ends(toScreen(frame, last.from), toScreen(frame, last.to))} />}
    </>
  );
}

function ends([x1, y1]: Corner, [x2, y2]: Corner) {
  return { x1, y1, x2, y2 };
}

/** A corner of the chosen outline, for keys; pointers take it from the map. */
function CornerHandle({ frame, idx, i, place }: { frame: Frame; idx: number; i: number; place: Corner }) {
  const [left, top] = toScreen(frame, place);
  const onKeyDown = (event: KeyboardEvent) => {
    const step = event.shiftKey ? FAR_NUDGE_M : NUDGE_M;
    const by: Record<string, Corner> = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    const move = by[event.key];
    if (move) {
      editGround(idx, say("ground.step.corner"), (of) => ({ ...of, polygon: withCorner(of.polygon, i, [place[0] + move[0], place[1] + move[1]]) }), `corner ${idx} ${i}`);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      editGround(idx, say("ground.step.noCorner"), (of) => ({ ...of, polygon: withoutCorner(of.polygon, i) }));
    } else if (event.key === "Insert" || event.key === "Enter") {
      editGround(idx, say("ground.step.newCorner"), (of) => ({ ...of, polygon: withCornerAfter(of.polygon, i) }));
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <span role="button" tabIndex={0} class="corner" style={{ left: `${left}px`, top: `${top}px` }} onKeyDown={onKeyDown}
      aria-label={say("ground.corner", { n: i + 1, x: place[0], y: place[1] })} title={say("ground.corner.help")} />
  );
}

export function GroundMap({ frame, onFrame, chosen, onChoose }: {
  frame: Frame;
  onFrame: (change: (frame: Frame) => Frame) => void;
  chosen: number;
  onChoose: (idx: number) => void;
}) {
  const latest = useRef(frame);
  latest.current = frame;
  const document = draft.value?.scene.document;
  const grounds = document?.ground ?? [];
  const own = grounds[chosen];
  const at = (px: Corner) => toWorld(latest.current, px);

  const finish = () => {
    if (drawn.value.length >= 3) onChoose(addGround(drawn.value.map(rounded)));
    take("choose");
  };

  const dragCorner = (i: number): Drag => ({
    move: (px) => editGround(chosen, say("ground.step.corner"), (of) => ({
      ...of, polygon: withCorner(of.polygon, i, snapped(at(px), latest.current, grounds, chosen)),
    }), `corner ${chosen} ${i}`),
    end: settle,
    cancel: settle,
  });

  const pressCorner = (px: Corner): Drag | null => {
    if (!own) return null;
    const screens = own.polygon.map((place) => toScreen(frame, corner(place)));
    const near = screens.findIndex((other) => apart(other, px) < REACH_PX);
    if (near >= 0) return dragCorner(near);
    const edge = screens.findIndex((other, i) => apart(middle(other, screens[(i + 1) % screens.length] ?? other), px) < REACH_PX);
    if (edge < 0) return null;
    editGround(chosen, say("ground.step.newCorner"), (of) => ({ ...of, polygon: withCornerAfter(of.polygon, edge) }));
    return dragCorner(edge + 1);
  };

  const pressPicture = (px: Corner): Drag | null => {
    if (!own?.imagery?.control_points) return null;
    let last = at(px);
    return {
      move: (next) => {
        const place = at(next);
        const shift: Corner = [place[0] - last[0], place[1] - last[1]];
        last = place;
        editImagery(chosen, say("ground.step.move"), (of) => movedImagery(of, { about: [0, 0], shift }), `picture ${chosen}`);
      },
      end: settle,
      cancel: settle,
    };
  };

  const pressLine = (px: Corner): Drag => {
    const from = at(px);
    line.value = { from, to: from };
    return {
      move: (next) => { line.value = { from, to: at(next) }; },
      end: (_next, _event, isClick) => {
        if (isClick) line.value = null;
        else if (tool.value === "north") turnNorth(chosen);
      },
      cancel: () => { line.value = null; },
    };
  };

  const click = (px: Corner) => {
    const place = at(px);
    if (tool.value !== "draw") {
      const found = grounds.findLastIndex(({ polygon }) => isInside(polygon, place));
      if (found >= 0) onChoose(found);
      return;
    }
    const [first] = drawn.value;
    if (first && drawn.value.length >= 3 && apart(toScreen(frame, first), px) < REACH_PX) finish();
    else drawn.value = [...drawn.value, rounded(snapped(place, frame, grounds, -1))];
  };

  const press = (px: Corner): Drag | null => {
    if (isReadOnly.value) return null;
    if (tool.value === "choose") return pressCorner(px);
    if (tool.value === "move") return pressPicture(px);
    return tool.value === "draw" ? null : pressLine(px);
  };

  const onKeyDown = (event: KeyboardEvent) => {
    const pan = 40;
    const by: Record<string, Corner> = { ArrowLeft: [pan, 0], ArrowRight: [-pan, 0], ArrowUp: [0, pan], ArrowDown: [0, -pan] };
    const move = by[event.key];
    if (event.key === "Escape") take("choose");
    else if (event.key === "Enter" && tool.value === "draw") finish();
    else if (event.key === "Backspace" && tool.value === "draw") drawn.value = drawn.value.slice(0, -1);
    else if (event.key === "0") onFrame((before) => fitted(extent(grounds), before.size_px));
    else if (move) onFrame((before) => ({ ...before, center: [before.center[0] - move[0] / before.scale, before.center[1] + move[1] / before.scale] }));
    else return;
    event.preventDefault();
  };

  return (
    <PlanMap label={say("ground.map")} frame={frame} onFrame={onFrame} handlers={{ press, click }} onKeyDown={onKeyDown}
      cursor={tool.value === "choose" ? "grab" : tool.value === "move" ? "move" : "crosshair"}
      under={grounds.map(({ imagery }, i) => imagery && <GroundPicture key={i} imagery={imagery} origin={document?.origin} frame={frame} />)}
      over={!isReadOnly.value && own?.polygon.map((place, i) => <CornerHandle key={i} frame={frame} idx={chosen} i={i} place={corner(place)} />)}>
      <Outlines frame={frame} grounds={grounds} chosen={chosen} />
      {own && !isReadOnly.value && tool.value === "choose" && own.polygon.map((place, i) => {
        const [cx, cy] = toScreen(frame, middle(corner(place), corner(own.polygon[(i + 1) % own.polygon.length] ?? place)));
        return <circle key={i} class="ground-add" cx={cx} cy={cy} r={4} />;
      })}
      <Cameras frame={frame} />
    </PlanMap>
  );
}

/** The extent of all outlines, and of the origin; null of none. */
export function extent(grounds: readonly Ground[]) {
  const places = grounds.flatMap(({ polygon }) => polygon.map(corner));
  if (places.length === 0) return null;
  const all = (axis: 0 | 1) => places.map((place) => place[axis]);
  return { low: [Math.min(...all(0)), Math.min(...all(1))] as const, high: [Math.max(...all(0)), Math.max(...all(1))] as const };
}
