// Lines along a building: enough of them give direction and focal length, one place and a height (or pairs) the rest.

import { useSignal, useSignalEffect } from "@preact/signals";
import { told } from "../../ask";
import { Table } from "../../parts/parts";
import { say } from "../../strings";
import { NumberField } from "../Fields";
import { type Turned, vanishing } from "../requests";
import { missing, placed, telling } from "./building";
import { AXIS_COLORS, axis } from "./drawing";
import { removeLine } from "./edits";
import * as now from "./now";
import { document } from "./scene";
import { type Extent, FIRST_HEIGHT_M, extent, first, point } from "./torch";

const REST_MILLIS = 250;

type Found = { readonly turned: Turned | null; readonly failure: string | null; readonly isAsking: boolean };
const NOTHING: Found = { turned: null, failure: null, isAsking: false };

/** Asks the daemon whenever there are enough lines and they rest. */
function useTurned() {
  const found = useSignal<Found>(NOTHING);
  useSignalEffect(() => {
    const [lines, size, of] = [now.lines.value, now.size.value, now.calibrating.value];
    if (!size || missing(lines).length > 0) {
      found.value = NOTHING;
      return undefined;
    }
    const focal = of && !of.findsFocal ? (now.calibration.value?.focal_px[0] ?? null) : null;
    let isOver = false;
    found.value = { ...found.peek(), isAsking: true };
    const timer = setTimeout(() => {
      vanishing(size, telling(lines), focal).then(
        (turned) => !isOver && (found.value = { turned, failure: null, isAsking: false }),
        (error: unknown) => !isOver && (found.value = { turned: null, failure: told(error), isAsking: false }),
      );
    }, REST_MILLIS);
    return () => {
      isOver = true;
      clearTimeout(timer);
    };
  });
  return found;
}

const middleOf = ({ low, high, level_m }: Extent): [number, number, number] => [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, level_m];

function Missing() {
  const open = missing(now.lines.value);
  if (open.length === 0) return null;
  return <p>{say("cameras.lines.missing", { what: open.map(({ axis: name, n }) => say("cameras.lines.missing.one", { n, axis: name })).join(", ") })}</p>;
}

function LineTable({ turned }: { turned: Turned | null }) {
  const counts = { x: 0, y: 0, z: 0 };
  return (
    <Table caption={say("cameras.lines")} none={say("cameras.lines.none")} columns={["cameras.column.line", "cameras.column.px", "cameras.column.do"]}
      rows={now.lines.value.map(({ axis: name }, idx) => {
        const line_idx = counts[name]++;
        const miss = turned?.misses.find((one) => one.axis === name && one.line_idx === line_idx);
        return [
          <><span class="cal-swatch" style={{ background: AXIS_COLORS[name] }} aria-hidden="true" /> {say(`cameras.axis.${name}`)} {line_idx + 1}</>,
          miss ? Math.abs(miss.offset_px).toFixed(1) : "",
          <button key="remove" type="button" aria-label={say("cameras.lines.remove", { axis: name, n: line_idx + 1 })} onClick={() => removeLine(idx)}>{say("cameras.remove")}</button>,
        ];
      })} />
  );
}

export function LinesPanel() {
  const found = useTurned();
  const height = useSignal<number | null>(FIRST_HEIGHT_M);
  const yaw = useSignal(0);
  const isOtherWay = useSignal(false);
  const isPlaced = useSignal(true);

  useSignalEffect(() => {
    const [turned, size, camera] = [found.value.turned, now.size.value, now.chosen.value];
    if (!turned || !size || !camera || now.how.value !== "lines") return;
    // A calibration that is taken over is a part of the document, and proposes nothing anew.
    const of = document.peek();
    const before = now.calibration.peek() ?? first(of, size);
    const ground = extent(of);
    const above = height.value === null ? null : ground.level_m + height.value;
    const from = now.calibration.peek() || above === null ? point(before.position_m) : point([before.position_m[0] ?? 0, before.position_m[1] ?? 0, above]);
    // More than one place says by itself how high it stands.
    const got = placed(turned, size, yaw.value, now.pairs.value, now.pairs.value.length > 1 ? null : above, from, middleOf(ground), isOtherWay.value);
    isPlaced.value = got.isPlaced;
    now.proposal.value = { camera: camera.id, calibration: got.calibration, from: "lines" };
  });

  const turnedBoxes = (document.value.boxes ?? []).filter(({ yaw_deg = 0 }) => yaw_deg % 90 !== 0);
  const { turned, failure, isAsking } = found.value;
  return (
    <div class="cal-panel">
      <div class="cal-column">
        <p>{say(`cameras.lines.about.${axis.value}`)}</p>
        <LineTable turned={turned} />
        <Missing />
      </div>
      <div class="cal-column">
        {turnedBoxes.length > 0 && (
          <label class="field">{say("cameras.lines.along")}
            <select value={String(yaw.value)} onChange={(event) => (yaw.value = Number(event.currentTarget.value))}>
              <option value="0">{say("cameras.lines.along.world")}</option>
              {turnedBoxes.map(({ id, yaw_deg = 0 }) => <option key={id} value={String(yaw_deg)}>{say("cameras.lines.along.box", { name: id, yaw: yaw_deg })}</option>)}
            </select>
          </label>
        )}
        {now.pairs.value.length < 2 && (
          <NumberField label={say("cameras.lines.height")} hint={say("cameras.lines.height.hint")} unit="m" value={height.value} isOptional onChange={(value) => (height.value = value)} />
        )}
        <div role="status" aria-live="polite">
          {isAsking && !turned && <p>{say("cameras.working")}</p>}
          {failure !== null && <p class="cal-refused">{say("cameras.lines.refused")} {failure}</p>}
          {turned && <p>{say("cameras.lines.found", { px: turned.rms_px.toFixed(1), focal: turned.focal_px.toFixed(0) })}</p>}
          {turned && !isPlaced.value && <p>{say("cameras.lines.unplaced")} <button type="button" onClick={() => now.chooseHow("pairs")}>{say("cameras.lines.toPairs")}</button></p>}
        </div>
        {turned && <p><button type="button" onClick={() => (isOtherWay.value = !isOtherWay.value)}>{say("cameras.lines.otherWay")}</button></p>}
        <p class="quiet">{say("cameras.lines.about")}</p>
      </div>
    </div>
  );
}
