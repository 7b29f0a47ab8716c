// What people do to the things of the draft: each one step that can be undone, named as people see it, and said.

import type { Point } from "../../operate/orbit";
import { say } from "../../strings";
import { type SceneDocument, draft, editScene, isReadOnly, settle } from "../draft";
import { idFrom } from "../ids";
import type { Corner } from "../plan/frame";
import { checkThing } from "./checks";
import * as operations from "./operations";
import { support } from "./pick";
import { chosen, choose, fileExtents, frame, hidden, preview, said, setHidden, shown } from "./state";
import { type Thing, extentOf, ids, thing } from "./things";

/** Copies stand so far beside, metres. */
const BESIDE_M = 1;

const names = (of: readonly string[]) => (of.length === 1 ? (of[0] ?? "") : say("geometry.count", { count: of.length }));

function now(): SceneDocument | null {
  return draft.value?.scene.document ?? null;
}

/** Ends a drag: what was shown becomes a step; nothing where it was refused. */
export function commitPreview(label: string): void {
  const next = preview.value;
  preview.value = null;
  if (!next) return;
  settle();
  editScene(label, () => next);
}

/** A step over the chosen things. Steps under the same key shortly after one another are one. */
function step(label: string, change: (document: SceneDocument) => SceneDocument, key?: string): void {
  editScene(label, change, key);
  said.value = label;
}

export function moveChosen(by: Point): void {
  const of = chosen.value;
  if (of.length === 0) return;
  step(say("geometry.step.move", { what: names(of) }), (document) => operations.move(document, of, by), `move ${of.join()}`);
}

export function turnChosen(byDeg: number): void {
  const of = chosen.value;
  const extent = operations.extentOfAll(shown.value, of, fileExtents.value);
  if (!extent) return;
  step(say("geometry.step.turn", { what: names(of) }), (document) => operations.turn(document, of, extent.middle, byDeg), `turn ${of.join()}`);
}

export function removeChosen(): void {
  const of = chosen.value;
  if (of.length === 0) return;
  step(say("geometry.step.remove", { what: names(of) }), (document) => operations.remove(document, of));
  setHidden(of, false);
  choose([]);
}

export function duplicateChosen(): void {
  const of = chosen.value;
  const document = now();
  const extent = document && operations.extentOfAll(document, of, fileExtents.value);
  if (!extent || isReadOnly.value) return;
  const width = Math.max(...extent.outline.map(([x]) => x)) - Math.min(...extent.outline.map(([x]) => x));
  const made = operations.duplicate(document, of, [operations.tidy(width + BESIDE_M), 0, 0]);
  step(say("geometry.step.duplicate", { what: names(of) }), () => made.document);
  choose(made.copies);
}

/** Brings what is chosen down, or up, onto what is below it. */
export function standChosen(): void {
  const of = chosen.value;
  step(say("geometry.step.stand", { what: names(of) }), (document) => of.reduce((next, id) => {
    const one = thing(next, id);
    if (!one) return next;
    const { middle, low } = extentOf(one, fileExtents.value);
    const { height } = support(next, middle, { except: new Set(of), files: fileExtents.value });
    return operations.move(next, [id], [0, 0, operations.tidy(height - low)]);
  }, document));
}

/** Renames a thing; answers why not, or null. */
export function renameThing(id: string, next: string): "form" | "taken" | null {
  const document = now();
  const fault = document ? operations.idFault(document, id, next) : null;
  if (fault !== null || next === id) return fault;
  // Those of the address that are not there are not chosen: asked before the old id goes.
  const after = chosen.value.map((one) => (one === id ? next : one));
  const isHidden = hidden.value.has(id);
  step(say("geometry.step.rename", { what: id, name: next }), (of) => operations.rename(of, id, next));
  choose(after);
  if (isHidden) setHidden([next], true);
  return null;
}

/** Adds what was drawn or brought, under an id that is free, and chooses it. Answers false where it was refused. */
export function addThing(usual: string, make: (id: string) => Thing): boolean {
  const document = now();
  if (!document || isReadOnly.value) return false;
  const id = idFrom(usual, ids(document), "thing");
  const made = make(id);
  const [check] = checkThing(made);
  if (check) {
    said.value = say(`geometry.check.${check.key}`, check.values);
    return false;
  }
  step(say("geometry.step.add", { what: id }), (of) => operations.add(of, made));
  choose([id]);
  return true;
}

/** Changes one thing by its panel. */
export function changeThing(id: string, field: string, change: (one: Thing) => Thing): void {
  editScene(say("geometry.step.change", { what: id }), (document) => operations.update(document, [id], change), `${id} ${field}`);
}

/** Changes all of the chosen things, such as their colour. */
export function changeChosen(field: string, change: (one: Thing) => Thing): void {
  const of = chosen.value;
  editScene(say("geometry.step.change", { what: names(of) }), (document) => operations.update(document, of, change), `${of.join()} ${field}`);
}

/** Changes what is of the whole scene. */
export function changeScene(label: string, field: string, change: (document: SceneDocument) => SceneDocument): void {
  editScene(label, change, field);
}

/** Where something comes to stand that is brought without a pointer: in the middle of what the map shows. */
export function middlePlace(): { at: Corner; base: number } {
  const at: Corner = frame.value ? [operations.tidy(frame.value.center[0]), operations.tidy(frame.value.center[1])] : [0, 0];
  return { at, base: support(shown.value, at, { files: fileExtents.value }).height };
}
