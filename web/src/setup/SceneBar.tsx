// Which scene is set up: one of the daemon's, or a new one with a name and an id.

import { useState } from "preact/hooks";
import { told } from "../ask";
import * as state from "../operate/state";
import { say } from "../strings";
import { changes, count } from "./changes";
import { base, draft, edit, isReadOnly } from "./draft";
import { idFrom, isId } from "./ids";
import { beginAnew, isBeginning } from "./load";
import { confirmed } from "./Question";
import { result } from "./save";

/** No id of a scene reads so. */
const NEW = "+";

async function choose(id: string): Promise<void> {
  const [of, from] = [draft.value, base.value];
  const isChanged = of && from && !isReadOnly.value && count(changes(of, from)) > 0;
  if (isChanged && !(await confirmed(say("setup.scene.leave"), say("setup.discard")))) return;
  await beginAnew(id === NEW ? null : id);
  result.value = null;
}

/** Names the scene; of a new one the id follows the name until somebody writes it. */
function rename(name: string): void {
  const taken = (state.scenes.value ?? []).map(({ id }) => id);
  edit(say("setup.step.name"), (of) => {
    const { name: before, ...rest } = of.scene.document;
    const follows = base.value?.sceneTag === null && of.scene.id === idFrom(before ?? "", taken, "site");
    const document = name === "" ? rest : { ...rest, name };
    return { ...of, scene: { id: follows ? idFrom(name, taken, "site") : of.scene.id, document } };
  }, "scene.name");
}

export function SceneBar() {
  const [failure, setFailure] = useState<string | null>(null);
  const of = draft.value;
  if (!of) return null;
  const { id, document } = of.scene;
  const isNew = base.value?.sceneTag === null;
  const scenes = state.scenes.value ?? [];
  const isTaken = isNew && scenes.some((scene) => scene.id === id);
  const wrong = isId(id) ? (isTaken ? say("setup.scene.taken") : null) : say("setup.id.wrong");
  return (
    <div class="scene-bar">
      <label class="inline">
        {say("setup.scene")}{" "}
        <select value={isNew ? NEW : id} onChange={(event) => {
          const { currentTarget } = event;
          void choose(currentTarget.value).then(() => setFailure(null), (error: unknown) => setFailure(told(error)));
          // It shows what is chosen, and that changes only once the question is answered.
          currentTarget.value = isNew ? NEW : id;
        }}>
          {scenes.map((scene) => <option key={scene.id} value={scene.id}>{scene.name}</option>)}
          {(!isReadOnly.value || isNew) && <option value={NEW}>{say("setup.scene.new")}</option>}
        </select>
      </label>
      <label class="inline">
        {say("setup.name")}{" "}
        <input type="text" maxLength={200} value={document.name ?? ""} placeholder={isNew ? say("setup.scene.name.hint") : id}
          disabled={isReadOnly.value || isBeginning.value} onInput={(event) => rename(event.currentTarget.value)} />
      </label>
      {isNew && (
        <label class="inline">
          {say("setup.id")}{" "}
          <input type="text" class="short" maxLength={64} value={id} spellcheck={false} aria-invalid={wrong !== null} aria-describedby="scene-id-wrong"
            disabled={isReadOnly.value || isBeginning.value}
            onInput={(event) => {
              const { value } = event.currentTarget;
              edit(say("setup.step.id"), (before) => ({ ...before, scene: { ...before.scene, id: value } }), "scene.id");
            }} />
        </label>
      )}
      <span id="scene-id-wrong" class="fault" role="status">{wrong ?? failure}</span>
    </div>
  );
}
