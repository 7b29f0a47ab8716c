// The control points of a picture in numbers: which pixel lies where. More than three tell how well they fit.

import { say } from "../../strings";
import { NumberField } from "../Fields";
import type { Corner } from "../plan/frame";
import { type Imagery, applied } from "./placement";
import { editImagery } from "./tools";

const FEWEST = 3;

type Points = NonNullable<Imagery["control_points"]>;

export function PointFields({ idx, imagery, rows, size }: { idx: number; imagery: Imagery; rows: readonly (readonly number[])[]; size: Corner }) {
  const points = imagery.control_points ?? [];
  const set = (change: (of: Points) => Points, key?: string) =>
    editImagery(idx, say("ground.step.point"), (of) => ({ ...of, control_points: change(of.control_points ?? []) }), key);
  const setNumber = (i: number, of: "pixel" | "world", axis: 0 | 1, value: number) => set((before) => before.map((point, j) => (
    j === i ? { ...point, [of]: point[of].map((other, k) => (k === axis ? value : other)) } : point
  )), `point ${idx} ${i} ${of} ${axis}`);
  const add = () => {
    const pixel: Corner = [size[0] / 2, size[1] / 2];
    set((before) => [...before, { pixel: [...pixel], world: [...applied(rows, pixel)] }]);
  };
  return (
    <>
      <p class="quiet">{say("ground.points.help")}</p>
      <ol class="corners">
        {points.map(({ pixel, world }, i) => (
          <li key={i}>
            <NumberField label={say("ground.point.column", { n: i + 1 })} value={pixel[0] ?? 0} places={1} onChange={(value) => setNumber(i, "pixel", 0, value ?? 0)} />
            <NumberField label={say("ground.point.row", { n: i + 1 })} value={pixel[1] ?? 0} places={1} onChange={(value) => setNumber(i, "pixel", 1, value ?? 0)} />
            <NumberField label={say("ground.corner.x", { n: i + 1 })} value={world[0] ?? 0} onChange={(value) => setNumber(i, "world", 0, value ?? 0)} />
            <NumberField label={say("ground.corner.y", { n: i + 1 })} value={world[1] ?? 0} onChange={(value) => setNumber(i, "world", 1, value ?? 0)} />
            <button type="button" disabled={points.length <= FEWEST} aria-label={say("ground.point.remove", { n: i + 1 })} title={say("ground.point.remove", { n: i + 1 })}
              onClick={() => set((before) => before.filter((_, j) => j !== i))}>−</button>
          </li>
        ))}
      </ol>
      <p><button type="button" onClick={add}>{say("ground.point.add")}</button></p>
    </>
  );
}
