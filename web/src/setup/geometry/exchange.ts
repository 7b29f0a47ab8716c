// Scenes of other programs: what is read becomes a step of the draft, what is written is a file.

import { change, send, Trouble } from "../../ask";
import { say } from "../../strings";
import { type SceneDocument, draft, editScene } from "../draft";

export const FORMATS = ["videofields", "paper", "gltf", "glb"] as const;
export type Format = (typeof FORMATS)[number];
export const IMPORT_ENDINGS = ".json,.gltf,.glb";
const ENDINGS: Record<Format, string> = { videofields: "json", paper: "paper.json", gltf: "gltf", glb: "glb" };
const TYPES: Record<Format, string> = { videofields: "application/json", paper: "application/json", gltf: "model/gltf+json", glb: "model/gltf-binary" };

export type Warning = { readonly pointer: string; readonly detail: string };

/** What a file is, by its name and by how it begins. */
export async function formatOf(file: File): Promise<Format> {
  const name = file.name.toLowerCase();
  if (name.endsWith(".glb")) return "glb";
  if (name.endsWith(".gltf")) return "gltf";
  const read = JSON.parse(await file.text()) as { format?: unknown; asset?: unknown } | null;
  if (read?.format === "video-fields") return "paper";
  return read?.asset === undefined ? "videofields" : "gltf";
}

/** A document that is taken in: cameras of the draft that it knows nothing of stay. */
export function mergedCameras(before: SceneDocument, next: SceneDocument): SceneDocument {
  const own = next.cameras ?? [];
  const others = (before.cameras ?? []).filter(({ id }) => !own.some((camera) => camera.id === id));
  return others.length === 0 ? next : { ...next, cameras: [...own, ...others] };
}

/** Reads a scene into the draft, and answers what the file said that is not held. Throws `Trouble` with the daemon's faults. */
export async function importScene(file: File): Promise<readonly Warning[]> {
  const id = draft.value?.scene.id;
  if (id === undefined) return [];
  let format: Format;
  try {
    format = await formatOf(file);
  } catch {
    throw new Trouble(say("geometry.import.unread"), 0);
  }
  const path = `/api/v1/scenes/${encodeURIComponent(id)}/import?format=${format}&validate_only=true`;
  const { document, warnings } = await change<{ document: SceneDocument; warnings: Warning[] }>("POST", path, file, { type: TYPES[format] });
  editScene(say("geometry.step.import", { name: file.name }), (before) => mergedCameras(before, document));
  return warnings;
}

function save(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = document.createElement("a");
  [link.href, link.download] = [url, name];
  link.click();
  // The browser has taken it by then.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Writes a file. The project's own form is the draft as it stands; others the daemon writes of what it keeps. Answers how much was left out. */
export async function exportScene(format: Format): Promise<number> {
  const of = draft.value;
  if (!of) return 0;
  const name = `${of.scene.id}.${ENDINGS[format]}`;
  if (format === "videofields") {
    save(name, new Blob([`${JSON.stringify(of.scene.document, null, 2)}\n`], { type: TYPES[format] }));
    return 0;
  }
  const response = await send(`/api/v1/scenes/${encodeURIComponent(of.scene.id)}/export?format=${format}`);
  if (!response.ok) {
    const problem = (await response.json().catch(() => null)) as { detail?: string } | null;
    throw new Trouble(problem?.detail ?? say("trouble.status", { status: response.status }), response.status);
  }
  save(name, await response.blob());
  return (response.headers.get("Videofields-Left-Out") ?? "").split(",").filter((part) => part.trim() !== "").length;
}
