// The outlines of the ground in numbers: which there are, corners, height and colour; and a rectangle to begin with.

import { useState } from "preact/hooks";
import { say } from "../../strings";
import { isReadOnly, settle } from "../draft";
import { NumberField, digits } from "../Fields";
import { atThing } from "../faults";
import type { Corner } from "../plan/frame";
import { FEWEST_CORNERS, area, corner, crosses, rectangle, withCorner, withCornerAfter, withoutCorner } from "./polygon";
import { type Ground, addGround, drawn, editGround, removeGround, take, tool } from "./tools";

export function QuickStart({ onAdded, around }: { onAdded: (idx: number) => void; around: Corner }) {
  const [size, setSize] = useState<Corner>([40, 30]);
  const isDrawing = tool.value === "draw";
  return (
    <div class="row bottom">
      <NumberField label={say("ground.width")} unit="m" value={size[0]} min={0.1} max={1e5} onChange={(value) => setSize([value ?? 0, size[1]])} />
      <NumberField label={say("ground.depth")} unit="m" value={size[1]} min={0.1} max={1e5} onChange={(value) => setSize([size[0], value ?? 0])} />
      <button type="button" onClick={() => onAdded(addGround(rectangle(size[0], size[1], around)))}>{say("ground.rectangle")}</button>
      <button type="button" class={isDrawing ? "is-on" : ""} aria-pressed={isDrawing} onClick={() => take(isDrawing ? "choose" : "draw")}>{say("ground.draw")}</button>
      {isDrawing && <p class="quiet" role="status">{say("ground.draw.help", { count: drawn.value.length })}</p>}
    </div>
  );
}

function Corners({ idx, polygon }: { idx: number; polygon: readonly (readonly number[])[] }) {
  const set = (i: number, place: Corner) =>
    editGround(idx, say("ground.step.corner"), (of) => ({ ...of, polygon: withCorner(of.polygon, i, place) }), `corner ${idx} ${i}`);
  return (
    <ol class="corners">
      {polygon.map((place, i) => {
        const [x, y] = corner(place);
        return (
          <li key={i}>
            <NumberField label={say("ground.corner.x", { n: i + 1 })} value={x} min={-1e8} max={1e8} onChange={(value) => set(i, [value ?? 0, y])} />
            <NumberField label={say("ground.corner.y", { n: i + 1 })} value={y} min={-1e8} max={1e8} onChange={(value) => set(i, [x, value ?? 0])} />
            <button type="button" aria-label={say("ground.corner.add", { n: i + 1 })} title={say("ground.corner.add", { n: i + 1 })}
              onClick={() => editGround(idx, say("ground.step.newCorner"), (of) => ({ ...of, polygon: withCornerAfter(of.polygon, i) }))}>+</button>
            <button type="button" aria-label={say("ground.corner.remove", { n: i + 1 })} title={say("ground.corner.remove", { n: i + 1 })} disabled={polygon.length <= FEWEST_CORNERS}
              onClick={() => editGround(idx, say("ground.step.noCorner"), (of) => ({ ...of, polygon: withoutCorner(of.polygon, i) }))}>−</button>
          </li>
        );
      })}
    </ol>
  );
}

export function OutlinePanel({ grounds, chosen, onChoose, around }: {
  grounds: readonly Ground[];
  chosen: number;
  onChoose: (idx: number) => void;
  around: Corner;
}) {
  const own = grounds[chosen];
  const details = { ground: String(chosen) };
  return (
    <fieldset class="card" disabled={isReadOnly.value}>
      <legend class="hidden">{say("ground.outlines")}</legend>
      <h2>{say("ground.outlines")}</h2>
      {grounds.length === 0 && <p>{say("ground.none")}</p>}
      <QuickStart onAdded={onChoose} around={around} />
      {grounds.length > 1 && (
        <label class="inline">
          {say("ground.which")}{" "}
          <select value={chosen} onChange={(event) => onChoose(Number(event.currentTarget.value))}>
            {grounds.map(({ polygon }, i) => <option key={i} value={i}>{say("ground.outline", { n: i + 1, area: digits(area(polygon), 0) })}</option>)}
          </select>
        </label>
      )}
      {own && (
        <>
          <div class="row bottom">
            <NumberField label={say("ground.height")} unit="m" value={own.height_m ?? 0} min={-1e8} max={1e8} fault={atThing("ground", details, "height_m")}
              onChange={(value) => editGround(chosen, say("ground.step.height"), (of) => ({ ...of, height_m: value ?? 0 }), `height ${chosen}`)} />
            <label class="field">
              {say("ground.color")}
              <input type="color" value={own.color_srgb ?? "#8a8a84"} onChange={settle}
                onInput={(event) => {
                  const color_srgb = event.currentTarget.value;
                  editGround(chosen, say("ground.step.color"), (of) => ({ ...of, color_srgb }), `color ${chosen}`);
                }} />
            </label>
            <button type="button" class="push" onClick={() => removeGround(chosen)}>{say("ground.remove")}</button>
          </div>
          <p class="quiet">{say("ground.area", { area: digits(area(own.polygon), 1) })}</p>
          <p class="fault" role="status">{crosses(own.polygon) ? say("ground.crosses") : atThing("ground", details, "polygon")}</p>
          <details open={own.polygon.length <= 8}>
            <summary>{say("ground.corners", { count: own.polygon.length })}</summary>
            <Corners idx={chosen} polygon={own.polygon} />
          </details>
        </>
      )}
    </fieldset>
  );
}
