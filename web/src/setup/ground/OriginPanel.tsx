// Where the scene's origin lies on the earth (WGS 84), and what that makes of metres.

import { useState } from "preact/hooks";
import { say } from "../../strings";
import { draft, editScene, isReadOnly } from "../draft";
import { NumberField, TextField } from "../Fields";
import { atThing } from "../faults";
import { type Bounds } from "../plan/frame";
import { type Origin, hundredMetres, onEarth, readPlace } from "./earth";

const PLACES = 7;

function set(change: (of: Origin) => Origin | undefined, mergeKey?: string): void {
  editScene(say("ground.step.origin"), (document) => {
    const { origin, ...rest } = document;
    const next = change(origin ?? { latitude_deg: 0, longitude_deg: 0, height_m: 0 });
    return next ? { ...rest, origin: next } : rest;
  }, mergeKey);
}

function degrees({ latitude_deg, longitude_deg }: Origin): string {
  const half = (value: number, names: string) => `${Math.abs(value).toFixed(6)}° ${names[value < 0 ? 1 : 0] ?? ""}`;
  return `${half(latitude_deg, "NS")}, ${half(longitude_deg, "EW")}`;
}

function Where({ origin, bounds }: { origin: Origin; bounds: Bounds | null }) {
  const { longitudeDeg, latitudeDeg } = hundredMetres(origin);
  return (
    <ul class="quiet where">
      <li>{say("ground.origin.hundred", { east: longitudeDeg.toFixed(6), north: latitudeDeg.toFixed(6) })}</li>
      {bounds && <li>{say("ground.origin.low", { place: degrees(onEarth(origin, bounds.low)) })}</li>}
      {bounds && <li>{say("ground.origin.high", { place: degrees(onEarth(origin, bounds.high)) })}</li>}
    </ul>
  );
}

export function OriginPanel({ bounds }: { bounds: Bounds | null }) {
  const [text, setText] = useState("");
  const origin = draft.value?.scene.document.origin;
  const isUnread = text.trim() !== "" && readPlace(text) === null;
  const fault = (field: string) => atThing("ground", {}, `origin/${field}`);
  return (
    <fieldset class="card" disabled={isReadOnly.value}>
      <legend class="hidden">{say("ground.origin")}</legend>
      <h2>{say("ground.origin")}</h2>
      <p class="quiet">{say("ground.origin.help")}</p>
      <TextField label={say("ground.origin.paste")} value={text} placeholder="52.0903, 5.1212" fault={isUnread ? say("ground.origin.unread") : fault("")}
        onInput={(value) => {
          setText(value);
          const place = readPlace(value);
          if (place) set((of) => ({ ...of, ...place }), "origin");
        }} />
      {origin && (
        <>
          <div class="row top">
            <NumberField label={say("ground.latitude")} unit="°" value={origin.latitude_deg} min={-90} max={90} places={PLACES} fault={fault("latitude_deg")}
              onChange={(value) => set((of) => ({ ...of, latitude_deg: value ?? 0 }), "latitude")} />
            <NumberField label={say("ground.longitude")} unit="°" value={origin.longitude_deg} min={-180} max={180} places={PLACES} fault={fault("longitude_deg")}
              onChange={(value) => set((of) => ({ ...of, longitude_deg: value ?? 0 }), "longitude")} />
            <NumberField label={say("ground.altitude")} unit="m" value={origin.height_m ?? 0} min={-1e4} max={1e5} hint={say("ground.altitude.hint")} fault={fault("height_m")}
              onChange={(value) => set((of) => ({ ...of, height_m: value ?? 0 }), "altitude")} />
          </div>
          <Where origin={origin} bounds={bounds} />
          <p><button type="button" onClick={() => {
            setText("");
            set(() => undefined);
          }}>{say("ground.origin.remove")}</button></p>
        </>
      )}
    </fieldset>
  );
}
