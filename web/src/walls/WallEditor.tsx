// One wall: what it shows, drawn as it stands; its numbers; its screens; and what it was before.

import { useEffect, useState } from "preact/hooks";
import { change as changeRoute } from "../route";
import { session } from "../session";
import { Sure } from "../parts/Sure";
import { say } from "../strings";
import { clock } from "../units";
import * as editor from "./draft";
import { TextField } from "./fields";
import { FrontDrawing } from "./FrontDrawing";
import { type Tile, tilesOf } from "./layout";
import { LayoutFields } from "./LayoutFields";
import { usePreview } from "./preview";
import { Screens } from "./Screens";
import { ShowFields } from "./ShowFields";
import { TopDrawing } from "./TopDrawing";
import { Versions } from "./Versions";
import type { Wall } from "./document";

const moveTile = (idx: number, tile: Tile) => editor.edit(({ surface, ...wall }) => ({
  ...wall, surface: surface.kind === "tiles" ? { ...surface, tiles: surface.tiles.map((old, i) => (i === idx ? tile : old)) } : surface,
}), `tile.${idx}.move`);

const setRadius = (radius_m: number) => editor.edit(({ surface, ...wall }) => ({
  ...wall, surface: surface.kind === "cylinder" ? { ...surface, radius_m } : surface,
}), "radius");

function Drawings({ wall, chosen, onChoose }: { wall: Wall; chosen: number; onChoose: (idx: number) => void }) {
  const faults = editor.faults.value;
  const preview = usePreview(wall, editor.isSound.value);
  const canDrag = editor.mayChange.value;
  const shared = { wall, chosen, canDrag, onChoose, onMove: moveTile, onEnd: editor.settle };
  return (
    <section class="card drawings" aria-label={say("wall.drawing")}>
      <h2>{say("wall.front")}</h2>
      <FrontDrawing {...shared} preview={preview} faults={faults} />
      <p class="quiet" aria-live="off">
        {preview.failure !== null ? <span class="wrong">{say("wall.preview.failed", { message: preview.failure })}</span>
          : preview.time !== null ? say("wall.preview.time", { time: clock(Date.parse(preview.time)) }) : say("wall.preview.coming")}
      </p>
      <h2>{say("wall.top")}</h2>
      <TopDrawing {...shared} onRadius={setRadius} onViewer={(viewer_m) => editor.edit((of) => ({ ...of, viewer_m }), "viewer")} />
      {canDrag && <p class="quiet">{say(wall.surface.kind === "tiles" ? "wall.drag.tiles" : wall.surface.kind === "cylinder" ? "wall.drag.cylinder" : "wall.drag.grid")}</p>}
    </section>
  );
}

function Bar({ trouble, onError }: { trouble: string; onError: (text: string) => void }) {
  const isNew = editor.base.value.id === null;
  const isDirty = editor.isDirty.value;
  const faults = editor.faults.value;
  const [changed, setChanged] = useState(false);
  const [isBusy, setBusy] = useState(false);
  const attempt = async (deed: () => Promise<unknown>) => {
    setBusy(true);
    try {
      onError("");
      await deed();
      setChanged(false);
    } catch (error) {
      setChanged((error as { status?: number }).status === 412 && !isNew);
      onError(editor.reason(error));
    }
    setBusy(false);
  };
  const save = (isForced: boolean) => attempt(async () => {
    const id = await editor.save(isForced);
    changeRoute({ wall: id, new: null });
  });
  const close = () => changeRoute({ wall: null, new: null }, true);
  return (
    <div class="choices wall-bar">
      <button type="button" onClick={close}>{say("wall.back")}</button>
      {editor.mayChange.value && (
        <>
          <button type="button" disabled={!editor.canUndo.value} onClick={editor.undo}>{say("wall.undo")}</button>
          <button type="button" disabled={!editor.canRedo.value} onClick={editor.redo}>{say("wall.redo")}</button>
          <button type="button" class="is-main" disabled={isBusy || !isDirty || faults.size > 0} onClick={() => void save(false)}>{say("wall.save")}</button>
          {changed && <Sure text={say("wall.overwrite")} question={say("wall.overwrite.sure")} onSure={() => void save(true)} />}
          {isDirty && <Sure text={say("wall.discard")} question={say("wall.discard.sure")} onSure={() => void attempt(async () => {
            await editor.discard();
            if (isNew) close();
          })} />}
          {!isNew && <Sure text={say("wall.remove")} question={say("wall.remove.sure")} onSure={() => void attempt(async () => {
            await editor.remove();
            close();
          })} />}
          <p class="quiet" role="status">
            {faults.size > 0 ? say("wall.faults", { n: faults.size }) : say(isDirty ? (isNew ? "wall.isNew" : "wall.isDirty") : "wall.isKept")}
          </p>
        </>
      )}
      <div role="alert">{trouble && <p class="trouble">{trouble}</p>}</div>
    </div>
  );
}

function onKeys(event: KeyboardEvent): void {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
  event.preventDefault();
  if (event.shiftKey) editor.redo();
  else editor.undo();
}

export function WallEditor() {
  const [chosen, setChosen] = useState(0);
  const [trouble, setTrouble] = useState("");
  useEffect(() => {
    addEventListener("keydown", onKeys);
    return () => removeEventListener("keydown", onKeys);
  }, []);
  const now = editor.draft.value;
  if (!now) return null;
  const { id, wall } = now;
  const { id: keptId, wall: kept } = editor.base.value;
  const faults = editor.faults.value;
  const isNew = keptId === null;
  const title = wall.name || id || say("wall.new");
  return (
    <>
      <h1>{title}</h1>
      <Bar trouble={trouble} onError={setTrouble} />
      <div class="wall-editor">
        <Drawings wall={wall} chosen={chosen} onChoose={setChosen} />
        <fieldset class="wall-fields" disabled={!editor.mayChange.value}>
          <legend class="hidden">{say("wall.numbers")}</legend>
          <section class="card" aria-label={say("wall.named")}>
            <TextField label={say("wall.name")} pointer="/name" faults={faults} value={wall.name} onChange={(name) => {
              // A new wall's id follows its name until it is given one.
              if (isNew && id === idOf(wall.name)) editor.rename(idOf(name));
              editor.edit((of) => ({ ...of, name }), "name");
            }} />
            <TextField label={say("wall.id")} pointer="/id" faults={faults} value={id} isFixed={!isNew} onChange={editor.rename} help={say("wall.id.help")} />
          </section>
          <LayoutFields wall={wall} faults={faults} chosen={chosen} onChoose={setChosen} />
          <ShowFields wall={wall} faults={faults} />
        </fieldset>
      </div>
      {keptId !== null && kept && <Screens wall={keptId} tiles={tilesOf(kept.surface)} />}
      {keptId !== null && session.value?.role === "admin" && <Versions id={keptId} onError={setTrouble} />}
    </>
  );
}

/** An id made of a name. */
function idOf(name: string): string {
  return name.normalize("NFKD").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 64);
}
