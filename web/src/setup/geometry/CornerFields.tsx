// A footprint's corners in numbers.

import { say } from "../../strings";
import { NumberField } from "../Fields";
import { changeThing } from "./actions";
import { faultAt } from "./fieldFaults";
import { tidy } from "./operations";
import type { Footprint, Thing } from "./things";

type One = Extract<Thing, { list: "footprints" }>;
const FEWEST = 3;

function change(one: One, field: string, of: (polygon: number[][]) => number[][]): void {
  changeThing(one.of.id, field, (now) => {
    const footprint = now.of as Footprint;
    return { list: "footprints", of: { ...footprint, polygon: of(footprint.polygon) } };
  });
}

/** A corner in the middle of the edge that begins at this one. */
function withMiddle(polygon: number[][], i: number): number[][] {
  const [a = [], b = []] = [polygon[i], polygon[(i + 1) % polygon.length]];
  const middle = [0, 1].map((axis) => tidy(((a[axis] ?? 0) + (b[axis] ?? 0)) / 2));
  return [...polygon.slice(0, i + 1), middle, ...polygon.slice(i + 1)];
}

export function CornerFields({ one }: { one: One }) {
  const { polygon } = one.of;
  return (
    <details class="geo-corners">
      <summary>{say("geometry.corners", { count: polygon.length })}</summary>
      {faultAt(one, "polygon") !== undefined && <p class="fault" role="alert">{faultAt(one, "polygon")}</p>}
      <ol>
        {polygon.map((corner, i) => {
          const fault = faultAt(one, `polygon/${i}`);
          return (
            <li key={i}>
              {(["x", "y"] as const).map((axis, j) => (
                <NumberField key={axis} label={say("geometry.corner", { n: i + 1, axis })} min={-1e8} max={1e8} value={corner[j] ?? 0}
                  onChange={(value) => value !== null && change(one, `corner ${i} ${axis}`, (of) => of.map((at, k) => (k === i ? at.map((old, l) => (l === j ? value : old)) : at)))} />
              ))}
              <button type="button" aria-label={say("geometry.corner.add", { n: i + 1 })} title={say("geometry.corner.add", { n: i + 1 })}
                onClick={() => change(one, "corner", (of) => withMiddle(of, i))}>+</button>
              <button type="button" aria-label={say("geometry.corner.remove", { n: i + 1 })} title={say("geometry.corner.remove", { n: i + 1 })} disabled={polygon.length <= FEWEST}
                onClick={() => change(one, "corner", (of) => of.filter((_, k) => k !== i))}>×</button>
              {fault !== undefined && <p class="fault" role="alert">{fault}</p>}
            </li>
          );
        })}
      </ol>
    </details>
  );
}
