// Scenes of other programs: import and export.

import { useRef, useState } from "preact/hooks";
import { Trouble, told } from "../../ask";
import { say } from "../../strings";
import { changes } from "../changes";
import { base, draft, isReadOnly } from "../draft";
import { FORMATS, type Format, IMPORT_ENDINGS, exportScene, importScene } from "./exchange";

type Outcome = { readonly text: string; readonly isBad: boolean; readonly points: readonly string[] };

const placed = (at: string | undefined, detail: string) => (at ? `${at}: ${detail}` : detail);

async function outcome(doing: Promise<{ text: string; points: readonly string[] }>): Promise<Outcome> {
  try {
    return { ...(await doing), isBad: false };
  } catch (error) {
    const points = error instanceof Trouble ? error.faults.map(({ pointer, parameter, detail }) => placed(pointer ?? parameter, detail)) : [];
    const text = told(error);
    return { text, isBad: true, points: points.filter((one) => one !== text) };
  }
}

async function read(file: File) {
  const warnings = await importScene(file);
  const text = say(warnings.length > 0 ? "geometry.import.warned" : "geometry.import.done", { name: file.name });
  return { text, points: warnings.map(({ pointer, detail }) => placed(pointer, detail)) };
}

async function write(format: Format) {
  const count = await exportScene(format);
  return { text: count > 0 ? say("geometry.export.left", { count }) : say("geometry.export.done"), points: [] };
}

/** Whether the daemon keeps another scene than the draft. */
function isAhead(): boolean {
  return draft.value !== null && base.value !== null && changes(draft.value, base.value).isScene;
}

export function Exchange() {
  const input = useRef<HTMLInputElement>(null);
  const [told, setTold] = useState<Outcome | null>(null);
  const isNew = base.value?.sceneTag === null;
  return (
    <section class="card geo-exchange" aria-label={say("geometry.exchange")}>
      <h2>{say("geometry.exchange")}</h2>
      <div class="row">
        <button type="button" disabled={isReadOnly.value} onClick={() => input.current?.click()}>{say("geometry.import")}</button>
        <details class="geo-formats">
          <summary>{say("geometry.export")}</summary>
          <div>
            {FORMATS.map((format) => (
              <button key={format} type="button" disabled={isNew && format !== "videofields"}
                onClick={(event) => {
                  event.currentTarget.closest("details")?.removeAttribute("open");
                  void outcome(write(format)).then(setTold);
                }}>
                {say(`geometry.format.${format}`)}
              </button>
            ))}
            {isAhead() && <p class="quiet">{say("geometry.export.kept")}</p>}
          </div>
        </details>
      </div>
      <input ref={input} type="file" accept={IMPORT_ENDINGS} hidden aria-label={say("geometry.import")}
        onChange={(event) => {
          const [file] = event.currentTarget.files ?? [];
          if (file) void outcome(read(file)).then(setTold);
          event.currentTarget.value = "";
        }} />
      <div role="status">
        {told && (
          <div class={`note ${told.isBad ? "is-bad" : "is-good"}`}>
            {told.text}
            {told.points.length > 0 && <ul>{told.points.map((text) => <li key={text}>{text}</li>)}</ul>}
          </div>
        )}
      </div>
    </section>
  );
}
