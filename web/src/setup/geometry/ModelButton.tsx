// Models from files: kept with the draft, and put in the middle of the map.

import { useRef } from "preact/hooks";
import { told } from "../../ask";
import { say } from "../../strings";
import { keepFile } from "../assets";
import { isReadOnly } from "../draft";
import { nameFrom } from "../ids";
import { addThing, middlePlace } from "./actions";
import { said } from "./state";

const MOST_BYTES = 64 * 1024 * 1024;
export const MODEL_ENDINGS = ".glb,.gltf,.ply";

/** What is wrong with a file as a model or picture; null where nothing is. */
export function fileFault({ name, size }: File, endings: string): string | null {
  if (!endings.split(",").some((ending) => name.toLowerCase().endsWith(ending))) return say("geometry.file.kind", { endings });
  return size > MOST_BYTES ? say("geometry.file.large") : null;
}

/** A .gltf that names files beside it could not be read again. */
async function isWhole(file: File): Promise<boolean> {
  if (!file.name.toLowerCase().endsWith(".gltf")) return true;
  const { buffers = [], images = [] } = JSON.parse(await file.text()) as { buffers?: { uri?: string }[]; images?: { uri?: string }[] };
  return [...buffers, ...images].every(({ uri }) => uri === undefined || uri.startsWith("data:"));
}

async function bring(file: File): Promise<void> {
  try {
    const fault = fileFault(file, MODEL_ENDINGS) ?? ((await isWhole(file)) ? null : say("geometry.file.parts"));
    if (fault !== null) {
      said.value = fault;
      return;
    }
    const path = await keepFile(file);
    const { at, base } = middlePlace();
    addThing(nameFrom(file.name) || "model", (id) => ({ list: "models", of: { id, file: path, position_m: [...at, base] } }));
  } catch (error) {
    said.value = told(error);
  }
}

export function ModelButton() {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button type="button" disabled={isReadOnly.value} title={say("geometry.model.title")} onClick={() => input.current?.click()}>
        <svg viewBox="0 0 24 24" width="20" height="20" aria-hidden="true"><path d="M4 17V9l8-6 8 6v8l-8 4zM12 3v8m0 0l8-2m-8 2L4 9m8 2v10" /></svg>
        <span>{say("geometry.tool.model")}</span>
      </button>
      <input ref={input} type="file" accept={MODEL_ENDINGS} hidden aria-label={say("geometry.model.title")}
        onChange={(event) => {
          const [file] = event.currentTarget.files ?? [];
          if (file) void bring(file);
          event.currentTarget.value = "";
        }} />
    </>
  );
}
