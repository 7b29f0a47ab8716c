// The scene's surfaces while the stage is shown: what is drawn in three dimensions, and what lines of sight meet.

import { computed, effect, signal } from "@preact/signals";
import { dependOn } from "../../depend";
import type { Point } from "../../operate/orbit";
import type { Ray } from "../../spatial/lens";
import { type Surfaces, surfacesOf } from "../../spatial/surfaces";
import { say, sayWord } from "../../strings";
import { type SceneDocument, draft } from "../draft";
import { corners, edges } from "./snaps";

export const surfaces = signal<Surfaces | null>(null);
/** Counts what changed of how surfaces look, such as pictures that came. */
export const surfacesChanged = signal(0);

/** The document without cameras: moving a camera changes nothing that is drawn of the scene. */
export const document = computed((): SceneDocument => draft.value?.scene.document ?? { version: 1 });
const parts = computed(() => {
  const { ground, height_fields, boxes, cylinders, footprints, models, sky, origin } = document.value;
  return JSON.stringify([ground, height_fields, boxes, cylinders, footprints, models, sky, origin]);
});

/** What a click may mean. */
export const known = computed(() => {
  dependOn(parts);
  const of = document.peek();
  return { corners: corners(of), edges: edges(of) };
});

/** Keeps the surfaces at the draft's document. Answers what ends it. */
export function follow(): () => void {
  const end = effect(() => {
    dependOn(parts);
    const of = document.peek();
    const before = surfaces.peek();
    if (before) before.update(of);
    else surfaces.value = surfacesOf(of, { onChange: () => (surfacesChanged.value = surfacesChanged.peek() + 1) });
  });
  return () => {
    end();
    surfaces.peek()?.dispose();
    surfaces.value = null;
  };
}

/** What a line of sight meets first. */
export function met(ray: Ray): { place: Point; thing: string; distance_m: number } | null {
  const picked = surfaces.peek()?.pick(ray);
  return picked ? { place: picked.point_m, thing: thingName(picked.key), distance_m: picked.distance_m } : null;
}

/** A thing of the scene by its JSON pointer, as people call it. */
export function thingName(key: string): string {
  const [, kind = "", index = ""] = key.split("/");
  const list = document.peek()[kind as keyof SceneDocument] as readonly { id?: string }[] | undefined;
  const name = list?.[Number(index)]?.id ?? String(Number(index) + 1);
  return say("cameras.thing", { kind: sayWord("cameras.kind", kind), name });
}
