// Pairs as a table, by how much each misses, and as numbers to type for whoever does not click.

import { useSignal } from "@preact/signals";
import { Table } from "../../parts/parts";
import type { Point } from "../../operate/orbit";
import { say, sayWord } from "../../strings";
import type { Pair } from "../draft";
import { NumberField } from "../Fields";
import * as edits from "./edits";
import { metres } from "./FitBar";
import * as now from "./now";
import { color } from "./pairs";
import { known } from "./scene";
import type { Snap } from "./snaps";
import { setTakesOver, takesOver, wanted } from "./solving";

const AXES = ["x", "y", "z"] as const;

/** What a corner is called. */
export function snapName({ of, name, corner, isTop }: Snap): string {
  if (of === "grid") return say("cameras.snap.grid");
  if (of === "edge") return say("cameras.snap.edge");
  const thing = say("cameras.thing", { kind: sayWord("cameras.kind", of), name });
  return say(isTop ? "cameras.snap.top" : "cameras.snap.corner", { thing, corner });
}

function Row({ idx, pair }: { idx: number; pair: Pair }) {
  const fit = now.fitted.value;
  const isChosen = now.selected.value === idx;
  const isWorst = fit?.worst === idx;
  return (
    <>
      <button type="button" class="cal-number" aria-pressed={isChosen} aria-label={say("cameras.pair.choose", { n: idx + 1 })}
        onClick={() => (now.selected.value = isChosen ? null : idx)}>
        <span class="cal-swatch" style={{ background: color(idx) }} aria-hidden="true" /> {idx + 1}
      </button>
      {isWorst && <> <span class="badge" data-state="waiting">{say("cameras.pair.worst")}</span></>}
      <span class="hidden">{pair.place_m.join(", ")}</span>
    </>
  );
}

function PairTable() {
  const fit = now.fitted.value;
  return (
    <Table caption={say("cameras.pairs")} none={say("cameras.pairs.none")}
      columns={["cameras.column.pair", "cameras.column.picture", "cameras.column.place", "cameras.column.px", "cameras.column.m", "cameras.column.do"]}
      rows={now.pairs.value.map((pair, idx) => {
        const miss = fit?.misses[idx];
        return [
          <Row key="row" idx={idx} pair={pair} />,
          pair.picture_px.map((px) => px.toFixed(1)).join(", "),
          pair.place_m.map((m) => m.toFixed(2)).join(", "),
          miss ? Math.hypot(...miss.offset_px).toFixed(1) : miss === null ? say("cameras.pair.off") : "",
          miss ? metres(miss.distance_m) : "",
          <button key="remove" type="button" aria-label={say("cameras.pair.remove", { n: idx + 1 })} onClick={() => edits.removePair(idx)}>{say("cameras.remove")}</button>,
        ];
      })} />
  );
}

/** The chosen pair's numbers. */
function Chosen() {
  const idx = now.selected.value;
  const pair = idx === null ? undefined : now.pairs.value[idx];
  if (idx === null || !pair) return null;
  const key = `cameras:typed:${idx}`;
  const put = <Of extends readonly number[]>(of: Of, i: number, value: number | null) => of.map((old, j) => (j === i ? (value ?? old) : old)) as unknown as Of;
  return (
    <fieldset>
      <legend>{say("cameras.pair.edit", { n: idx + 1 })}</legend>
      <div class="row top">
        {(["x", "y"] as const).map((name, i) => (
          <NumberField key={`picture-${name}`} label={say("cameras.pair.picture", { axis: name })} unit="px" places={2} value={pair.picture_px[i] ?? 0}
            onChange={(value) => edits.movePair(idx, { picture_px: put(pair.picture_px, i, value) }, key)} />
        ))}
        {AXES.map((name, i) => (
          <NumberField key={name} label={say("cameras.pair.place", { axis: name })} unit="m" value={pair.place_m[i] ?? 0}
            onChange={(value) => edits.movePair(idx, { place_m: put(pair.place_m, i, value) }, key)} />
        ))}
      </div>
    </fieldset>
  );
}

/** A place to be typed, or chosen from those that the scene has. */
function NewPlace() {
  const typed = useSignal<readonly (number | null)[]>([null, null, 0]);
  const corner = useSignal(0);
  const { corners } = known.value;
  const groups = new Map<string, number[]>();
  corners.forEach(({ of, name }, i) => {
    const group = say("cameras.thing", { kind: sayWord("cameras.kind", of), name });
    groups.set(group, [...(groups.get(group) ?? []), i]);
  });
  const n = now.pairs.value.length + 1;
  const [x, y, z] = typed.value;
  const isWhole = typeof x === "number" && typeof y === "number" && typeof z === "number";
  const chosen = corners[corner.value];
  return (
    <fieldset>
      <legend>{say("cameras.pair.new", { n })}</legend>
      <form class="row top" onSubmit={(event) => {
        event.preventDefault();
        if (!isWhole) return;
        edits.offerPlace([x, y, z] satisfies Point);
        typed.value = [null, null, z];
      }}>
        {AXES.map((name, i) => (
          <NumberField key={name} label={say("cameras.pair.place", { axis: name })} unit="m" isOptional value={typed.value[i] ?? null}
            onChange={(value) => (typed.value = typed.value.map((old, j) => (j === i ? value : old)))} />
        ))}
        <button type="submit" disabled={!isWhole}>{say("cameras.pair.offer")}</button>
      </form>
      {corners.length > 0 && (
        <form class="row top" onSubmit={(event) => {
          event.preventDefault();
          if (chosen) edits.offerPlace(chosen.place);
        }}>
          <label class="field">{say("cameras.pair.known")}
            <select value={String(corner.value)} onChange={(event) => (corner.value = Number(event.currentTarget.value))}>
              {[...groups].map(([group, members]) => (
                <optgroup key={group} label={group}>
                  {members.map((i) => corners[i] && <option key={i} value={String(i)}>{snapName(corners[i])}</option>)}
                </optgroup>
              ))}
            </select>
          </label>
          <button type="submit">{say("cameras.pair.offer")}</button>
        </form>
      )}
    </fieldset>
  );
}

function Wanted() {
  const [of, camera] = [now.calibrating.value, now.chosen.value];
  if (!of || !camera) return null;
  const { findsFocal, findsK1 } = wanted(of, now.calibration.value);
  return (
    <fieldset>
      <legend>{say("cameras.wanted")}</legend>
      <label class="cal-check">
        <input type="checkbox" checked={findsFocal} disabled={now.calibration.value === null} onChange={(event) => edits.setWanted({ findsFocal: event.currentTarget.checked })} />
        {" "}{say("cameras.wanted.focal")} <span class="quiet">{say(now.calibration.value ? "cameras.wanted.focal.kept" : "cameras.wanted.focal.must")}</span>
      </label>
      <label class="cal-check">
        <input type="checkbox" checked={findsK1} onChange={(event) => edits.setWanted({ findsK1: event.currentTarget.checked })} />
        {" "}{say("cameras.wanted.k1")} <span class="quiet">{say("cameras.wanted.k1.hint")}</span>
      </label>
      <label class="cal-check">
        <input type="checkbox" checked={takesOver(camera.id)} onChange={(event) => setTakesOver(camera.id, event.currentTarget.checked)} />
        {" "}{say("cameras.wanted.takes")} <span class="quiet">{say("cameras.wanted.takes.hint")}</span>
      </label>
    </fieldset>
  );
}

export function PairsPanel() {
  return (
    <div class="cal-panel">
      <div class="cal-column">
        <PairTable />
        {now.pairs.value.length > 1 && <p><button type="button" onClick={edits.removeAllPairs}>{say("cameras.pairs.removeAll")}</button></p>}
      </div>
      <div class="cal-column">
        <Chosen />
        <NewPlace />
        <Wanted />
      </div>
    </div>
  );
}
