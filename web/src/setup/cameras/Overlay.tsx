// What lies over the picture: pairs with their numbers, how far each misses, lines along axes, and what the calibration itself
// draws there: horizon, grid and edges.

import { useComputed } from "@preact/signals";
import { AXIS_COLORS, axis, begun } from "./drawing";
import { type Frame, type Pane, resolved, toScreen } from "./frame";
import { ENLARGED, calibrating, fitted, half, hovered, how, isEnlarged, lens, selected, showsGrid, showsOutline } from "./now";
import { type Pixel, color, pixelOf } from "./pairs";
import { document } from "./scene";
import { grid, horizon, outline } from "./sketch";

const RADIUS = 9;

/** A point that was clicked: a ring with an open middle, so that what was clicked stays to be seen. */
export function Marker({ at: [x, y], text, fill, isChosen = false, isWorst = false, isOpen = false }: {
  at: Pixel; text: string; fill: string; isChosen?: boolean; isWorst?: boolean; isOpen?: boolean;
}) {
  return (
    <g class={`cal-marker${isChosen ? " is-chosen" : ""}${isWorst ? " is-worst" : ""}${isOpen ? " is-open" : ""}`} transform={`translate(${x} ${y})`}>
      <circle class="cal-ring-shade" r={RADIUS} />
      <circle class="cal-ring" r={RADIUS} stroke={fill} />
      <path class="cal-cross" d="M-4 0H4M0-4V4" stroke={fill} />
      <text x={RADIUS + 3} y={-RADIUS + 2} fill={fill}>{text}</text>
    </g>
  );
}

function Arrow({ from, to, stroke }: { from: Pixel; to: Pixel; stroke: string }) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const reach = Math.hypot(dx, dy);
  if (reach < 0.5) return null;
  const [ux, uy] = [dx / reach, dy / reach];
  const tip = Math.min(7, reach);
  const wing = (side: number) => `L${to[0] - ux * tip - side * uy * tip * 0.5} ${to[1] - uy * tip + side * ux * tip * 0.5}`;
  const line = `M${from[0]} ${from[1]}L${to[0]} ${to[1]}${wing(1)}M${to[0]} ${to[1]}${wing(-1)}`;
  return <><path class="cal-arrow-shade" d={line} /><path class="cal-arrow" d={line} stroke={stroke} /></>;
}

/** The calibration's own drawing; its lines keep their breadth however close one comes. */
function Sketch({ frame, pane }: { frame: Frame; pane: Pane }) {
  const drawn = useComputed(() => (lens.value ? { ...grid(lens.value, document.value), edges: outline(lens.value, document.value), horizon: horizon(lens.value) } : null));
  const { at, scale } = resolved(frame, pane);
  const of = drawn.value;
  if (!of) return null;
  const [x, y] = [pane.screen[0] / 2 - at[0] * scale, pane.screen[1] / 2 - at[1] * scale];
  return (
    <svg class="cal-sketch" x={x} y={y} width={pane.picture[0] * scale} height={pane.picture[1] * scale} viewBox={`0 0 ${pane.picture.join(" ")}`} preserveAspectRatio="none">
      {showsGrid.value && <path class="cal-grid" d={of.thin} />}
      {showsGrid.value && <path class="cal-grid is-thick" d={of.thick} />}
      {showsOutline.value && <path class="cal-edges" d={of.edges} />}
      <path class="cal-horizon" d={of.horizon} />
    </svg>
  );
}

function Pairs({ show }: { show: (at: Pixel) => Pixel }) {
  const [fit, by] = [fitted.value, isEnlarged.value ? ENLARGED : 1];
  return (
    <>
      {calibrating.value?.pairs.map(({ picture_px }, i) => {
        const offset = fit?.misses[i]?.offset_px;
        return offset && <Arrow key={i} from={show(picture_px)} to={show([picture_px[0] + offset[0] * by, picture_px[1] + offset[1] * by])} stroke={color(i)} />;
      })}
      {calibrating.value?.pairs.map(({ picture_px }, i) => (
        <Marker key={i} at={show(picture_px)} text={String(i + 1)} fill={color(i)} isChosen={selected.value === i}
          isWorst={fit?.worst === i && how.value === "pairs"} />
      ))}
    </>
  );
}

/** One side of a pair that waits, and where the camera would show a place that waits. */
function Waiting({ show }: { show: (at: Pixel) => Pixel }) {
  const [waiting, n] = [half.value, calibrating.value?.pairs.length ?? 0];
  const expected = waiting?.place_m && lens.value ? pixelOf(lens.value, waiting.place_m) : null;
  return (
    <>
      {waiting?.picture_px && <Marker at={show(waiting.picture_px)} text={String(n + 1)} fill={color(n)} isChosen isOpen />}
      {expected && <circle class="cal-expected" cx={show(expected)[0]} cy={show(expected)[1]} r={14} stroke={color(n)} />}
    </>
  );
}

function Lines({ show }: { show: (at: Pixel) => Pixel }) {
  const [start, end] = [begun.value, hovered.value?.pixel];
  const drawn = (a: Pixel, b: Pixel, stroke: string, key: number) => {
    const d = `M${show(a).join(" ")}L${show(b).join(" ")}`;
    return (
      <g key={key}>
        <path class="cal-line-shade" d={d} /><path class="cal-line" d={d} stroke={stroke} />
        {[a, b].map((at, i) => <circle key={i} class="cal-line-end" cx={show(at)[0]} cy={show(at)[1]} r={5} stroke={stroke} />)}
      </g>
    );
  };
  return (
    <>
      {calibrating.value?.lines.map(({ axis: of, ends_px: [a, b] }, i) => drawn(a, b, AXIS_COLORS[of], i))}
      {start && drawn(start, end ?? start, AXIS_COLORS[axis.value], -1)}
    </>
  );
}

export function Overlay({ frame, pane, cross }: { frame: Frame; pane: Pane; cross: Pixel | null }) {
  const show = (at: Pixel) => toScreen(frame, pane, at);
  const at = cross && show(cross);
  return (
    <svg class="cal-overlay" width={pane.screen[0]} height={pane.screen[1]} aria-hidden="true">
      <Sketch frame={frame} pane={pane} />
      {how.value === "lines" && <Lines show={show} />}
      <Pairs show={show} />
      {how.value === "pairs" && <Waiting show={show} />}
      {at && <path class="cal-crosshair" d={`M${at[0] - 20} ${at[1]}h16m8 0h16M${at[0]} ${at[1] - 20}v16m0 8v16`} />}
    </svg>
  );
}
