// What the pointer does on the ground's map, and what is drawn and not part of the draft yet.

import { signal } from "@preact/signals";
import { say } from "../../strings";
import { type SceneDocument, edit, editScene } from "../draft";
import type { Corner } from "../plan/frame";
import { type Imagery, byNorth, movedImagery } from "./placement";

export const TOOLS = ["choose", "draw", "move", "length", "north"] as const;
export type Tool = (typeof TOOLS)[number];
export type Ground = NonNullable<SceneDocument["ground"]>[number];

export const tool = signal<Tool>("choose");
/** The line of a known length, or the arrow to the north, while it is drawn. */
export const line = signal<{ readonly from: Corner; readonly to: Corner } | null>(null);
/** The corners of an outline that is being drawn. */
export const drawn = signal<readonly Corner[]>([]);
/** Pixels of pictures that have been shown. */
export const sizes = signal<Readonly<Record<string, Corner>>>({});

export function take(next: Tool): void {
  [tool.value, line.value, drawn.value] = [next, null, []];
}

/** Changes one outline and what belongs to it. */
export function editGround(idx: number, label: string, change: (of: Ground) => Ground, mergeKey?: string): void {
  editScene(label, (document) => ({ ...document, ground: (document.ground ?? []).map((of, i) => (i === idx ? change(of) : of)) }), mergeKey);
}

/** Adds an outline; answers which it is. What follows at once under the same `mergeKey` is one step with it. */
export function addGround(polygon: number[][], mergeKey?: string): number {
  let idx = 0;
  editScene(say("ground.step.add"), (document) => {
    idx = document.ground?.length ?? 0;
    return { ...document, ground: [...(document.ground ?? []), { polygon, height_m: 0, color_srgb: "#8a8a84" }] };
  }, mergeKey);
  return idx;
}

export function removeGround(idx: number): void {
  edit(say("ground.step.remove"), (of) => {
    const ground = (of.scene.document.ground ?? []).filter((_, i) => i !== idx);
    return { ...of, scene: { ...of.scene, document: { ...of.scene.document, ground } } };
  });
}

export function editImagery(idx: number, label: string, change: (of: Imagery) => Imagery, mergeKey?: string): void {
  editGround(idx, label, (of) => (of.imagery ? { ...of, imagery: change(of.imagery) } : of), mergeKey);
}

/** Ends the arrow to the north: the picture is turned by it. */
export function turnNorth(idx: number): void {
  const move = line.value && byNorth(line.value.from, line.value.to);
  if (move) editImagery(idx, say("ground.step.north"), (of) => movedImagery(of, move));
  take("choose");
}
