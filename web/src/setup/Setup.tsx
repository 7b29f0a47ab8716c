// Set-up: four stages in any order, over one draft that can be undone and that is kept in this browser until it is saved.

import "./setup.css";
import { effect } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { told } from "../ask";
import { route } from "../route";
import { session } from "../session";
import { lookFirst } from "../spatial/served";
import { say } from "../strings";
import { areFilesUnkept, fileOf } from "./assets";
import { changes, count } from "./changes";
import { base, draft, isReadOnly, isUnkept, redo, undo } from "./draft";
import { watchElsewhere } from "./elsewhere";
import { beginWith, isBeginning, start, takenUp } from "./load";
import { Questions } from "./Question";
import { changedMeanwhile, result } from "./save";
import { Notes, SaveBar } from "./SaveBar";
import { SceneBar } from "./SceneBar";
import { OpenStage, StageList } from "./Stages";

// Pictures and models that were not sent yet are shown all the same.
lookFirst(fileOf);

effect(() => {
  const role = session.value?.role;
  if (role) isReadOnly.value = role !== "admin";
});

/** Begins a draft where there is none; anew where nothing was changed here, but somebody else did. */
async function arrive(): Promise<void> {
  const [of, from] = [draft.value, base.value];
  if (of && from) {
    const isOld = count(changes(of, from)) === 0 && (await changedMeanwhile().catch(() => null)) !== null;
    if (isOld) await beginWith(of.scene.id, of.calibrating);
    return;
  }
  await start(route.value.details["scene"]);
  if (takenUp.value === null) return;
  // Better told now than after an hour of work.
  const conflict = await changedMeanwhile().catch(() => null);
  if (conflict) result.value = { kind: "conflict", conflict };
}

/** Whether keys go into a text: then undoing is the text's own. */
function isText(target: EventTarget | null): boolean {
  const types = ["checkbox", "radio", "range", "color", "button", "file"];
  if (target instanceof HTMLInputElement) return !types.includes(target.type);
  return target instanceof HTMLTextAreaElement || (target instanceof HTMLElement && target.isContentEditable);
}

function onKey(event: KeyboardEvent): void {
  if (!(event.ctrlKey || event.metaKey) || event.altKey || isText(event.target) || document.querySelector("dialog[open]")) return;
  const key = event.key.toLowerCase();
  const isRedo = key === "y" || (key === "z" && event.shiftKey);
  if (!isRedo && key !== "z") return;
  event.preventDefault();
  if (isRedo) redo();
  else undo();
}

/** Warns where leaving would lose what the browser could not keep. */
function onLeave(event: BeforeUnloadEvent): void {
  const [of, from] = [draft.value, base.value];
  if ((isUnkept.value || areFilesUnkept.value) && of && from && count(changes(of, from)) > 0) event.preventDefault();
}

export default function Setup() {
  const [failure, setFailure] = useState<string | null>(null);
  const begin = () => void arrive().then(() => setFailure(null), (error: unknown) => setFailure(told(error)));
  useEffect(() => {
    begin();
    addEventListener("keydown", onKey);
    addEventListener("beforeunload", onLeave);
    const unwatch = watchElsewhere();
    return () => {
      unwatch();
      removeEventListener("keydown", onKey);
      removeEventListener("beforeunload", onLeave);
    };
  }, []);
  return (
    <div class="setup">
      <header class="setup-head">
        <h1>{say("setup.title")}</h1>
        <SceneBar />
        <SaveBar />
      </header>
      <StageList />
      <Notes />
      {failure !== null && (
        <p class="trouble" role="alert">{failure} <button type="button" onClick={begin}>{say("setup.again")}</button></p>
      )}
      {draft.value && !isBeginning.value ? <OpenStage /> : failure === null && <p class="quiet">{say("place.loading")} …</p>}
      <Questions />
    </div>
  );
}
