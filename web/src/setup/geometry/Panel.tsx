// The chosen things in numbers: everything that is dragged can be typed, too.

import { useState } from "preact/hooks";
import { say } from "../../strings";
import { isReadOnly, settle } from "../draft";
import { NumberField, TextField } from "../Fields";
import { changeChosen, changeThing, duplicateChosen, removeChosen, renameThing, standChosen, turnChosen } from "./actions";
import { CornerFields } from "./CornerFields";
import { faultAt } from "./fieldFaults";
import { tidy, tidyTurn } from "./operations";
import { PaintFields } from "./PaintFields";
import { ScenePanel } from "./ScenePanel";
import { chosen, isSkyChosen, shown } from "./state";
import { type Box, COLOR, type Cylinder, type Footprint, type Model, type Thing, point, thing } from "./things";

const EXTENT = { min: 0.001, max: 100_000 } as const;
const PLACE = { min: -1e8, max: 1e8 } as const;
const AXES = ["x", "y", "z"] as const;
/** By which angle the button turns. */
const QUARTER_DEG = 90;

type Of<List extends Thing["list"]> = Extract<Thing, { list: List }>;

/** A change of the thing's own members. */
function set<Value extends Thing["of"]>(one: { of: Value }, field: string, change: (of: Value) => Value): void {
  changeThing(one.of.id, field, (now) => ({ ...now, of: change(now.of as Value) }) as Thing);
}

const replaced = (numbers: readonly number[] | undefined, i: number, value: number): number[] => point(numbers).map((old, j) => (j === i ? value : old));

function Numbers({ one, legend, names, values, range, field, onChange }: {
  one: Thing;
  legend: string;
  names: readonly string[];
  values: readonly number[];
  range: { min: number; max: number };
  field: string;
  onChange: (i: number, value: number) => void;
}) {
  return (
    <fieldset class="geo-numbers">
      <legend>{legend}</legend>
      {values.map((value, i) => (
        <NumberField key={i} label={names[i] ?? ""} {...range} value={value} fault={faultAt(one, `${field}/${i}`)}
          onChange={(next) => next !== null && onChange(i, next)} />
      ))}
    </fieldset>
  );
}

function Place({ one, field, values, onChange }: { one: Thing; field: string; values: readonly number[]; onChange: (i: number, value: number) => void }) {
  return <Numbers one={one} legend={say("geometry.place")} names={AXES} field={field} values={values} range={PLACE} onChange={onChange} />;
}

function Yaw({ one, yaw }: { one: Of<"boxes"> | Of<"models">; yaw: number }) {
  return (
    <div class="row">
      <NumberField label={say("geometry.yaw")} unit="°" min={-360} max={360} value={yaw} fault={faultAt(one, "yaw_deg")}
        onChange={(value) => value !== null && set(one as { of: Box | Model }, "yaw", (of) => ({ ...of, yaw_deg: value }))} />
      <button type="button" onClick={() => set(one as { of: Box | Model }, "quarter", (of) => ({ ...of, yaw_deg: tidyTurn((of.yaw_deg ?? 0) + QUARTER_DEG) }))}>
        {say("geometry.quarter")}
      </button>
    </div>
  );
}

function BoxFields({ one }: { one: Of<"boxes"> }) {
  const [place, size] = [point(one.of.center_m), point(one.of.size_m)];
  // People think of where it stands, the document of its middle.
  const foot = [place[0], place[1], tidy(place[2] - size[2] / 2)];
  return (
    <>
      <Place one={one} field="center_m" values={foot}
        onChange={(i, value) => set<Box>(one, `place${i}`, (of) => ({ ...of, center_m: replaced(of.center_m, i, i === 2 ? tidy(value + point(of.size_m)[2] / 2) : value) }))} />
      <Numbers one={one} legend={say("geometry.size")} names={[say("geometry.length"), say("geometry.width"), say("geometry.height")]} field="size_m" values={size} range={EXTENT}
        onChange={(i, value) => set<Box>(one, `size${i}`, (of) => {
          const grown = i === 2 ? tidy(point(of.center_m)[2] + (value - point(of.size_m)[2]) / 2) : point(of.center_m)[2];
          return { ...of, size_m: replaced(of.size_m, i, value), center_m: replaced(of.center_m, 2, grown) };
        })} />
      <Yaw one={one} yaw={one.of.yaw_deg ?? 0} />
    </>
  );
}

function CylinderFields({ one }: { one: Of<"cylinders"> }) {
  return (
    <>
      <Place one={one} field="base_m" values={point(one.of.base_m)}
        onChange={(i, value) => set<Cylinder>(one, `place${i}`, (of) => ({ ...of, base_m: replaced(of.base_m, i, value) }))} />
      <fieldset class="geo-numbers">
        <legend>{say("geometry.size")}</legend>
        {(["radius_m", "height_m"] as const).map((field) => (
          <NumberField key={field} label={say(field === "radius_m" ? "geometry.radius" : "geometry.height")} {...EXTENT} value={one.of[field]} fault={faultAt(one, field)}
            onChange={(value) => value !== null && set<Cylinder>(one, field, (of) => ({ ...of, [field]: value }))} />
        ))}
      </fieldset>
    </>
  );
}

function FootprintFields({ one }: { one: Of<"footprints"> }) {
  const base = one.of.base_m ?? 0;
  return (
    <>
      <fieldset class="geo-numbers">
        <legend>{say("geometry.size")}</legend>
        <NumberField label={say("geometry.base")} {...PLACE} value={base} fault={faultAt(one, "base_m")}
          onChange={(value) => value !== null && set<Footprint>(one, "base", (of) => ({ ...of, base_m: value, top_m: tidy(of.top_m + value - (of.base_m ?? 0)) }))} />
        <NumberField label={say("geometry.height")} {...EXTENT} value={tidy(one.of.top_m - base)} fault={faultAt(one, "top_m")}
          onChange={(value) => value !== null && set<Footprint>(one, "top", (of) => ({ ...of, top_m: tidy((of.base_m ?? 0) + value) }))} />
      </fieldset>
      <CornerFields one={one} />
    </>
  );
}

function ModelFields({ one }: { one: Of<"models"> }) {
  const usual = one.of.file.toLowerCase().endsWith(".ply") ? "z" : "y";
  return (
    <>
      <p class="quiet">{one.of.file}</p>
      {faultAt(one, "file") !== undefined && <p class="fault" role="alert">{faultAt(one, "file")}</p>}
      <Place one={one} field="position_m" values={point(one.of.position_m)}
        onChange={(i, value) => set<Model>(one, `place${i}`, (of) => ({ ...of, position_m: replaced(of.position_m, i, value) }))} />
      <NumberField label={say("geometry.scale")} hint={say("geometry.scale.hint")} min={1e-6} max={1e6} places={6} value={one.of.scale ?? 1} fault={faultAt(one, "scale")}
        onChange={(value) => value !== null && set<Model>(one, "scale", (of) => ({ ...of, scale: value }))} />
      <Yaw one={one} yaw={one.of.yaw_deg ?? 0} />
      <label class="geo-check">
        <input type="checkbox" checked={(one.of.up ?? usual) === "z"}
          onChange={(event) => set<Model>(one, "up", (of) => ({ ...of, up: event.currentTarget.checked ? "z" : "y" }))} />
        {" "}{say("geometry.up")}
      </label>
    </>
  );
}

/** The name of what is chosen; another thing's is another field (by its key), so that nothing that is being typed is reset. */
function Name({ id }: { id: string }) {
  const [typed, setTyped] = useState(id);
  const [fault, setFault] = useState<"form" | "taken" | null>(null);
  return (
    <TextField label={say("geometry.name")} value={typed} maxLength={64} fault={fault === null ? undefined : say(`geometry.name.${fault}`)}
      onInput={(value) => {
        setTyped(value);
        setFault(null);
      }}
      onSettle={(value) => setFault(renameThing(id, value))} />
  );
}

/** The colour of one thing or of several. */
function Color({ of }: { of: readonly Thing[] }) {
  return (
    <label class="geo-color">
      <input type="color" value={of[0]?.of.color_srgb ?? COLOR}
        onInput={(event) => {
          const color_srgb = event.currentTarget.value;
          changeChosen("color", (one) => ({ ...one, of: { ...one.of, color_srgb } }) as Thing);
        }}
        onChange={settle} />
      {" "}{say("geometry.color")}
    </label>
  );
}

function Fields({ one }: { one: Thing }) {
  switch (one.list) {
    case "boxes":
      return <BoxFields one={one} />;
    case "cylinders":
      return <CylinderFields one={one} />;
    case "footprints":
      return <FootprintFields one={one} />;
    case "models":
      return <ModelFields one={one} />;
    case "height_fields":
      return <p class="quiet">{say("geometry.field", { columns: one.of.columns, rows: Math.floor(one.of.heights_m.length / one.of.columns) })}</p>;
  }
}

export function Panel() {
  const of = chosen.value.flatMap((id) => thing(shown.value, id) ?? []);
  const [one] = of;
  if (isSkyChosen.value || !one) return <ScenePanel isOpen={isSkyChosen.value} />;
  const isOne = of.length === 1;
  return (
    <section class="card geo-panel" aria-label={say("geometry.panel")}>
      <fieldset class="plain" disabled={isReadOnly.value}>
        <h2>{isOne ? one.of.id : say("geometry.count", { count: of.length })}</h2>
        {isOne && <Name key={one.of.id} id={one.of.id} />}
        {isOne && <Fields one={one} />}
        <Color of={of} />
        {isOne && one.list !== "models" && one.list !== "height_fields" && <PaintFields key={one.of.id} one={one} />}
        <div class="row">
          <button type="button" onClick={standChosen}>{say("geometry.stand")}</button>
          {!isOne && <button type="button" onClick={() => turnChosen(QUARTER_DEG)}>{say("geometry.quarter")}</button>}
          <button type="button" onClick={duplicateChosen}>{say("geometry.duplicate")}</button>
          <button type="button" onClick={removeChosen}>{say("geometry.remove")}</button>
        </div>
      </fieldset>
    </section>
  );
}
