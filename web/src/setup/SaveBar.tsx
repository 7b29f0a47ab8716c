// Undo and redo, what is not kept yet, and Save: with what came of it.

import { wayTo } from "../route";
import { say } from "../strings";
import { clock } from "../units";
import { areFilesUnkept } from "./assets";
import { changes, count } from "./changes";
import { base, draft, isReadOnly, isUnkept, redo, redoable, undo, undoable } from "./draft";
import { type Fault, open } from "./faults";
import { beginAnew, learnScenes, takenUp } from "./load";
import { confirmed } from "./Question";
import { isOpenElsewhere } from "./elsewhere";
import { type Conflict, keepMine, result, save, saving, takeTheirs } from "./save";
import { wayToStage } from "./Stages";

/** Which parts are not kept, in words. */
function pendingWords(): string | null {
  const [of, from] = [draft.value, base.value];
  if (!of || !from) return null;
  const pending = changes(of, from);
  if (count(pending) === 0) return null;
  const name = (id: string) => (of.cameras.find((camera) => camera.id === id) ?? from.cameras.find((camera) => camera.id === id))?.name || id;
  const cameras = [...pending.put, ...pending.patch].map(({ id }) => name(id));
  return [
    ...(pending.isScene ? [say(from.scene ? "setup.pending.scene" : "setup.pending.newScene")] : []),
    ...(cameras.length > 0 ? [say("setup.pending.cameras", { names: cameras.join(", ") })] : []),
    ...(pending.remove.length > 0 ? [say("setup.pending.removed", { names: pending.remove.map(name).join(", ") })] : []),
  ].join("; ");
}

async function saveAndTell(): Promise<void> {
  await save();
  takenUp.value = null;
  // Other places hear of a new scene at once.
  if (result.value?.kind === "saved") await learnScenes().catch(() => null);
}

async function discardAsked(): Promise<void> {
  const [of, from] = [draft.value, base.value];
  if (!of || !from || !(await confirmed(say("setup.discard.sure"), say("setup.discard")))) return;
  await beginAnew(from.sceneTag === null ? null : of.scene.id);
  result.value = null;
}

export function SaveBar() {
  const [back, again] = [undoable.value, redoable.value];
  const pending = pendingWords();
  const isIdle = saving.value === null;
  const isEmpty = base.value?.scene === null && base.value.cameras.length === 0;
  if (isReadOnly.value) return null;
  return (
    <div class="save-bar">
      <span class="pair">
        <button type="button" disabled={back === null} title={say("setup.undo.title")} onClick={undo}>
          <span aria-hidden="true">↶ </span>{back === null ? say("setup.undo") : say("setup.undo.what", { what: back })}
        </button>
        <button type="button" disabled={again === null} title={say("setup.redo.title")} onClick={redo}>
          <span aria-hidden="true">↷ </span>{again === null ? say("setup.redo") : say("setup.redo.what", { what: again })}
        </button>
      </span>
      <span class="pending quiet" role="status">
        {saving.value ?? (pending === null ? say(isEmpty ? "setup.pending.nothing" : "setup.pending.none") : say("setup.pending", { what: pending }))}
      </span>
      <span class="pair">
        <button type="button" disabled={pending === null || !isIdle} onClick={() => void discardAsked()}>{say("setup.discard")}</button>
        <button type="button" class="is-main" disabled={pending === null || !isIdle} onClick={() => void saveAndTell()}>{say("setup.save")}</button>
      </span>
    </div>
  );
}

function FaultLine({ fault: { stage, details, text, pointer, field } }: { fault: Fault }) {
  const outline = details["ground"] === undefined ? undefined : say("setup.fault.outline", { n: Number(details["ground"]) + 1 });
  const name = draft.value?.cameras.find(({ id }) => id === details["camera"])?.name;
  const thing = outline ?? (name || Object.values(details)[0]);
  const place = stage === null ? pointer : [say(`setup.stage.${stage}`), thing, field].filter(Boolean).join(" › ");
  return <li>{stage === null ? place : <a href={wayToStage(stage, details)}>{place}</a>}: {text}</li>;
}

function Faults() {
  if (open.value.length === 0) return result.value?.kind === "faults" ? <p class="note">{say("setup.faults.mended")}</p> : null;
  return (
    <div class="note is-bad">
      <p>{say("setup.faults")}</p>
      <ul>{open.value.map((fault) => <FaultLine key={`${fault.document.kind} ${fault.pointer} ${fault.text}`} fault={fault} />)}</ul>
    </div>
  );
}

function ConflictNote({ conflict }: { conflict: Conflict }) {
  const what = conflict.kind === "scene" ? say("setup.conflict.scene") : say("setup.conflict.camera", { name: conflict.id });
  const when = conflict.at === null ? "" : clock(Date.parse(conflict.at));
  return (
    <div class="note is-bad">
      <p>
        {conflict.at === null ? say("setup.conflict", { what }) : say("setup.conflict.when", { what, who: conflict.by ?? say("setup.conflict.somebody"), when })}{" "}
        {conflict.theirs === null && say("setup.conflict.gone")}
      </p>
      <p class="row">
        {conflict.theirs !== null && (
          <button type="button" onClick={() => takeTheirs(conflict)}>{say("setup.conflict.theirs")}</button>
        )}
        <button type="button" onClick={() => {
          keepMine(conflict);
          void saveAndTell();
        }}>{say("setup.conflict.mine")}</button>
      </p>
      <p class="quiet">{say("setup.conflict.help")}</p>
    </div>
  );
}

/** What came of saving, and what else who sets up should know. */
export function Notes() {
  const of = draft.value;
  const told = result.value;
  const left = takenUp.value;
  return (
    <div class="notes" aria-live="polite">
      {isReadOnly.value && <p class="note">{say("setup.readOnly")}</p>}
      {left !== null && pendingWords() !== null && (
        <p class="note">
          {left > 0 ? say("setup.takenUp", { when: clock(left) }) : say("setup.takenUp.some")}{" "}
          <button type="button" onClick={() => { takenUp.value = null; }}>{say("setup.takenUp.fine")}</button>
        </p>
      )}
      {(isUnkept.value || areFilesUnkept.value) && <p class="note is-bad">{say("setup.unkept")}</p>}
      {isOpenElsewhere.value && <p class="note is-bad">{say("setup.elsewhere")}</p>}
      <Faults />
      {told?.kind === "failed" && <p class="note is-bad">{say("setup.failed", { message: told.message })}</p>}
      {told?.kind === "conflict" && <ConflictNote conflict={told.conflict} />}
      {told?.kind === "saved" && of && pendingWords() === null && (
        <p class="note is-good">
          {say("setup.saved", { when: clock(told.at) })}{" "}
          {base.value?.sceneTag !== null && <a href={wayTo("operate", { scene: of.scene.id })}>{say("setup.saved.look")}</a>}
        </p>
      )}
    </div>
  );
}
