// Error against time: points that are labelled, joined where they belong to one knob. Who does not see it reads the table beside it.

import { useId } from "preact/hooks";
import { say } from "../../strings";
import type { Curve, Point } from "./curves";
import { type Scale, at, scaleOf, short, ticks } from "./scale";

const [WIDTH, HEIGHT] = [560, 300];
const EDGE = { left: 62, right: 16, top: 12, bottom: 44 } as const;
/** Width of a letter of a label, about. */
const LETTER = 5.6;
const LABEL_HEIGHT = 12;
/** More points than that are not labelled one by one. */
const MOST_LABELS = 12;

export type Label = { readonly point: Point; readonly x: number; readonly y: number; readonly text: string; readonly isLeft: boolean };

type Placed = { readonly point: Point; readonly x: number; readonly y: number };
type Box = readonly [left: number, top: number, right: number, bottom: number];

/** Where a label is tried: beside its point first, then higher and lower. */
const TRIES = [0, -7, 7, -13, 13, -19, 19, -26, 26, -33, 33];

const meet = (a: Box, b: Box) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];

/** Labels beside their points, where they cover neither one another nor other points, as far as there is room. */
export function placed(points: readonly Placed[], all: readonly Placed[], text: (point: Point) => string): Label[] {
  const taken: Box[] = all.map(({ x, y }) => [x - 5, y - 5, x + 5, y + 5]);
  return [...points].sort((a, b) => a.y - b.y).map(({ point, x, y }) => {
    const words = text(point);
    const width = words.length * LETTER;
    const boxAt = (isLeft: boolean, by: number): Box => {
      const left = isLeft ? x - 8 - width : x + 8;
      return [left, y + by - LABEL_HEIGHT / 2, left + width, y + by + LABEL_HEIGHT / 2];
    };
    const isFree = (box: Box) => box[0] >= 0 && box[2] <= WIDTH && box[1] >= 0 && box[3] <= HEIGHT - EDGE.bottom && !taken.some((other) => meet(box, other));
    const ways = TRIES.flatMap((by) => [false, true].map((isLeft) => ({ by, isLeft })));
    const { by, isLeft } = ways.find((way) => isFree(boxAt(way.isLeft, way.by))) ?? { by: 0, isLeft: x + 8 + width > WIDTH };
    taken.push(boxAt(isLeft, by));
    return { point, x: isLeft ? x - 8 : x + 8, y: y + by, text: words, isLeft };
  });
}

function Axes({ x, y, names }: { x: Scale; y: Scale; names: readonly [string, string] }) {
  const [right, bottom] = [WIDTH - EDGE.right, HEIGHT - EDGE.bottom];
  return (
    <g class="axes" aria-hidden="true">
      {ticks(x).map((value) => {
        const place = EDGE.left + at(x, value) * (right - EDGE.left);
        return (
          <g key={`x${value}`}>
            <line x1={place} x2={place} y1={EDGE.top} y2={bottom} />
            <text x={place} y={bottom + 15} text-anchor="middle">{short(value)}</text>
          </g>
        );
      })}
      {ticks(y).map((value) => {
        const place = bottom - at(y, value) * (bottom - EDGE.top);
        return (
          <g key={`y${value}`}>
            <line x1={EDGE.left} x2={right} y1={place} y2={place} />
            <text x={EDGE.left - 6} y={place + 3.5} text-anchor="end">{short(value)}</text>
          </g>
        );
      })}
      <text class="axis-name" x={(EDGE.left + right) / 2} y={HEIGHT - 6} text-anchor="middle">{names[0]}</text>
      <text class="axis-name" transform={`translate(13 ${(EDGE.top + bottom) / 2}) rotate(-90)`} text-anchor="middle">{names[1]}</text>
    </g>
  );
}

export function Chart({ curve, title, errorName }: { curve: Curve; title: string; errorName: string }) {
  const id = useId();
  const [x, y] = [scaleOf(curve.points.map(({ millis }) => millis)), scaleOf(curve.points.map(({ error }) => error))];
  const [right, bottom] = [WIDTH - EDGE.right, HEIGHT - EDGE.bottom];
  const place = (point: Point) => ({
    point, x: EDGE.left + at(x, point.millis) * (right - EDGE.left), y: bottom - at(y, point.error) * (bottom - EDGE.top),
  });
  const logs = [x.isLog ? say("system.chart.log") : "", y.isLog ? say("system.chart.log") : ""];
  const names = [`${say("system.chart.time")}${logs[0] ?? ""}`, `${errorName}${logs[1] ?? ""}`] as const;
  const hasManyKnobs = new Set(curve.points.map(({ knob }) => knob)).size > 1;
  const isSame = (one: Point, other: Point) => one.millis === other.millis && one.error === other.error;
  const single = curve.points.filter((point, i) => curve.points.findIndex((other) => isSame(point, other)) === i);
  // A whole pipeline's settings are long: those of its front are numbered and told beneath it; the table has all.
  const legend = curve.points.length > MOST_LABELS ? (curve.lines[0] ?? []) : [];
  const labels = legend.length > 0
    ? placed(legend.map(place), curve.points.map(place), (point) => String(legend.indexOf(point) + 1))
    : placed(single.map(place), single.map(place), (point) => (hasManyKnobs ? `${point.knob} ${point.value}` : point.value));
  return (
    <>
    <svg class="chart" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-labelledby={`${id}-title ${id}-desc`}>
      <title id={`${id}-title`}>{title}</title>
      <desc id={`${id}-desc`}>{say("system.chart.about", { n: curve.points.length })}</desc>
      <Axes x={x} y={y} names={names} />
      {curve.lines.map((line, i) => (
        <polyline key={i} class="line" data-line={i % 4} points={line.map((point) => { const to = place(point); return `${to.x.toFixed(1)},${to.y.toFixed(1)}`; }).join(" ")} />
      ))}
      {curve.points.map((point, i) => {
        const to = place(point);
        return <circle key={i} class={point.isDefault ? "point is-default" : "point"} cx={to.x} cy={to.y} r={point.isDefault ? 5.5 : 4} />;
      })}
      {labels.map((label) => (
        <text key={`${label.point.knob}${label.point.value}`} class="point-label" x={label.x} y={label.y + 3.5} text-anchor={label.isLeft ? "end" : "start"}>{label.text}</text>
      ))}
    </svg>
    {legend.length > 0 && <ol class="quiet legend">{legend.map(({ value }) => <li key={value}>{value}</li>)}</ol>}
    </>
  );
}
