// One camera of the draft: its picture, where from, which part, its clock; and taking it away.

import { useState } from "preact/hooks";
import { say } from "../../strings";
import { type DraftCamera, base, draft, edit, editCamera, isReadOnly } from "../draft";
import { NumberField, TextField } from "../Fields";
import { atCamera } from "../faults";
import { isId } from "../ids";
import { confirmed } from "../Question";
import { hasPlace } from "../stages";
import { withId, withName, withoutCamera } from "./edits";
import { PartFields } from "./PartFields";
import { PlaceFields } from "./PlaceFields";
import { SourcePicture, useSource } from "./SourcePicture";

type Given = { camera: DraftCamera; onId: (id: string | null) => void };

function NameFields({ camera, isKept, onId }: Given & { isKept: boolean }) {
  const { id, name, origin } = camera;
  if (isReadOnly.value) return null;
  if (origin === "configured") return <p class="quiet">{say("videos.name.configured")}</p>;
  const isTaken = (draft.value?.cameras ?? []).filter((other) => other.id === id).length > 1;
  const wrong = isId(id) ? (isTaken ? say("videos.id.taken") : undefined) : say("setup.id.wrong");
  return (
    <div class="row top">
      <TextField label={say("videos.name")} value={name} hint={say("videos.name.hint")} maxLength={200} fault={atCamera(id, "name")}
        onInput={(value) => {
          let next = id;
          edit(say("step.rename", { name: name || id }), (of) => {
            const named = withName(of, id, value, isKept);
            next = named.id;
            return named.draft;
          }, `name of ${(draft.value?.cameras ?? []).indexOf(camera)}`);
          onId(next);
        }} />
      {!isKept && (
        <TextField label={say("videos.id")} value={id} hint={say("videos.id.hint")} maxLength={64} fault={wrong}
          onInput={(value) => {
            // Two cameras of one id could not be told apart again.
            const isFree = !(draft.value?.cameras ?? []).some((other) => other.id === value);
            if (value === "" || !isFree) return;
            edit(say("step.id", { name: name || id }), (of) => withId(of, id, value), `id of ${(draft.value?.cameras ?? []).indexOf(camera)}`);
            onId(value);
          }} />
      )}
    </div>
  );
}

function ClockFields({ camera: { id, name, clock } }: { camera: DraftCamera }) {
  const label = say("step.clock", { name: name || id });
  const set = (change: DraftCamera["clock"], key: string) => editCamera(id, label, (of) => ({ ...of, clock: { ...of.clock, ...change } }), `${key} ${id}`);
  return (
    <fieldset>
      <legend>{say("videos.clock")}</legend>
      <div class="row top">
        <NumberField label={say("videos.offset")} unit="s" value={clock.offset_secs ?? 0} hint={say("videos.offset.hint")} min={-3.2e9} max={3.2e9}
          fault={atCamera(id, "clock/offset_secs")} onChange={(value) => set({ offset_secs: value ?? 0 }, "offset")} />
        <NumberField label={say("videos.drift")} unit="ppm" value={clock.drift_ppm ?? 0} hint={say("videos.drift.hint")} min={-58_823} max={58_823}
          fault={atCamera(id, "clock/drift_ppm")} onChange={(value) => set({ drift_ppm: value ?? 0 }, "drift")} />
      </div>
    </fieldset>
  );
}

function EndFields({ camera: { id, name, isEnabled, origin }, onId }: Given) {
  const shown = name || id;
  const remove = async () => {
    if (!(await confirmed(say("videos.remove.sure", { name: shown }), say("videos.remove")))) return;
    edit(say("step.remove", { name: shown }), (of) => withoutCamera(of, id));
    onId(null);
  };
  return (
    <div class="row">
      <label class="inline">
        <input type="checkbox" checked={isEnabled}
          onChange={(event) => {
            const { checked } = event.currentTarget;
            editCamera(id, say("step.enabled", { name: shown }), (of) => ({ ...of, isEnabled: checked }));
          }} />
        {" "}{say("videos.enabled")}
      </label>
      {origin !== "configured" && <button type="button" class="push" onClick={() => void remove()}>{say("videos.remove")}</button>}
    </div>
  );
}

export function CameraEditor({ camera, onId }: Given) {
  const { source } = camera;
  const [at, setAt] = useState(source.from_secs ?? 0);
  const isKept = base.value?.cameras.some(({ id }) => id === camera.id) ?? false;
  // The length is known from whichever picture came last of this file.
  const [length, setLength] = useState<{ path: string; secs: number | null; rateHz: number | null } | null>(null);
  const last = length?.path === source.path && length?.secs ? Math.max(0, length.secs - 1 / (length.rateHz ?? 25)) : Infinity;
  const { looked, ask } = useSource(camera, source.path ? Math.min(at, last) : 0);
  const { value } = looked;
  if (value && source.path && (length?.path !== source.path || length.secs !== value.duration_secs)) {
    setLength({ path: source.path, secs: value.duration_secs, rateHz: value.rate_hz });
  }
  const known = length?.path === source.path ? length : null;
  const fault = atCamera(camera.id, "source") ?? looked.trouble?.faults[0]?.detail ?? looked.trouble?.message;
  return (
    <section class="card editor" aria-labelledby="editor-title">
      <h2 id="editor-title">{camera.name || say("videos.unnamed")}</h2>
      <div class="editor-parts">
        <SourcePicture camera={camera} looked={looked} />
        <fieldset class="plain" disabled={isReadOnly.value}>
          <NameFields camera={camera} isKept={isKept} onId={onId} />
          {isReadOnly.value
            ? <p class="quiet">{source.path ?? source.url ?? source.device}</p>
            : <PlaceFields camera={camera} isKept={isKept} fault={fault} onLook={ask} onId={onId} />}
        </fieldset>
      </div>
      <fieldset class="plain" disabled={isReadOnly.value}>
        {source.path && (
          <PartFields camera={camera} length={known?.secs ?? null} rateHz={known?.rateHz ?? null} at={at} onAt={setAt} isDisabled={isReadOnly.value} />
        )}
        {(!isReadOnly.value || hasPlace(camera)) && <ClockFields camera={camera} />}
        <EndFields camera={camera} onId={onId} />
      </fieldset>
    </section>
  );
}
