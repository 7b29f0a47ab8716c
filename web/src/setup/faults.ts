// What is wrong with a draft, at the stage and the thing that it belongs to: the daemon names places of documents by JSON pointers.

import { computed, signal } from "@preact/signals";
import type { PlacedFault } from "../ask";
import { equal } from "./changes";
import { type Draft, draft } from "./draft";

export const STAGES = ["videos", "ground", "cameras", "geometry"] as const;
export type Stage = (typeof STAGES)[number];

/** Which document a pointer leads into. */
export type Document = { readonly kind: "scene" } | { readonly kind: "camera"; readonly id: string };

export type Fault = {
  readonly document: Document;
  readonly pointer: string;
  readonly text: string;
  /** Where it is mended; null where no stage shows it. */
  readonly stage: Stage | null;
  /** What the address names of it, such as the camera. */
  readonly details: Readonly<Record<string, string>>;
  /** The field: what of the pointer lies behind the thing, such as `source/path`. */
  readonly field: string;
  /** What stood there when it was refused: once something else stands there, the fault is over. */
  readonly value: unknown;
};

type Place = Pick<Fault, "stage" | "details" | "field">;

const LISTS_OF_GEOMETRY = ["boxes", "cylinders", "footprints", "height_fields", "models"];

/** The parts of a JSON pointer (RFC 6901). */
export function parts(pointer: string): string[] {
  return pointer.split("/").slice(1).map((part) => part.replaceAll("~1", "/").replaceAll("~0", "~"));
}

export function valueAt(document: unknown, pointer: string): unknown {
  return parts(pointer).reduce<unknown>((at, part) => (typeof at === "object" && at !== null ? (at as Record<string, unknown>)[part] : undefined), document);
}

function idAt(of: Draft, list: string, index: string): string {
  const id = valueAt(of.scene.document, `/${list}/${index}/id`);
  return typeof id === "string" ? id : index;
}

/** Where a pointer into the scene's document is mended. */
function placeInScene(of: Draft, pointer: string): Place {
  const [list = "", index, ...rest] = parts(pointer);
  const field = rest.join("/");
  if (list === "ground") return { stage: "ground", details: index === undefined ? {} : { ground: index }, field };
  if (list === "origin") return { stage: "ground", details: {}, field: ["origin", index, ...rest].filter((part) => part !== undefined).join("/") };
  if (list === "cameras") return { stage: "cameras", details: index === undefined ? {} : { camera: idAt(of, list, index) }, field };
  if (list === "sky") return { stage: "geometry", details: { thing: "sky" }, field: [index ?? "", ...rest].join("/") };
  if (LISTS_OF_GEOMETRY.includes(list)) return { stage: "geometry", details: index === undefined ? {} : { thing: idAt(of, list, index) }, field };
  return { stage: null, details: {}, field: parts(pointer).join("/") };
}

function whole(of: Draft, document: Document): unknown {
  if (document.kind === "scene") return of.scene.document;
  const camera = of.cameras.find(({ id }) => id === document.id);
  return camera && { name: camera.name, source: camera.source, clock: camera.clock, enabled: camera.isEnabled };
}

/** A fault that the daemon, or the page itself, found in a draft. */
export function placed(of: Draft, document: Document, { pointer = "", parameter, detail }: PlacedFault): Fault {
  const place: Place = document.kind === "scene"
    ? placeInScene(of, pointer)
    : { stage: "videos", details: { camera: document.id }, field: parts(pointer).join("/") };
  const text = parameter === undefined ? detail : `${parameter}: ${detail}`;
  return { document, pointer, text, ...place, value: valueAt(whole(of, document), pointer) };
}

/** What was found at the last saving. */
export const found = signal<readonly Fault[]>([]);

/** What of it still stands as it was refused. */
export const open = computed(() => {
  const of = draft.value;
  if (!of) return [];
  return found.value.filter((fault) => equal(fault.value, valueAt(whole(of, fault.document), fault.pointer)));
});

/** What is wrong at a field of a camera's source, clock or name; undefined where nothing is. */
export function atCamera(id: string, field: string): string | undefined {
  return open.value.find((fault) => fault.document.kind === "camera" && fault.document.id === id && fault.field.startsWith(field))?.text;
}

/** What is wrong of a stage's thing, such as `{ ground: "0" }`, from a field on. */
export function atThing(stage: Stage, details: Readonly<Record<string, string>>, field = ""): string | undefined {
  return open.value.find((fault) => fault.stage === stage && fault.document.kind === "scene" && fault.field.startsWith(field) && equal(fault.details, details))?.text;
}
