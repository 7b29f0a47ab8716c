// How cameras fared since System was opened: each change of a camera's state, with the reason that the daemon gave.

import { effect, signal } from "@preact/signals";
import * as state from "../operate/state";

export type Change = { readonly camera: string; readonly from: string | null; readonly to: string; readonly at: number; readonly reason: string | null };

const MOST_CHANGES = 500;

/** The newest first. */
export const changes = signal<readonly Change[]>([]);
const known = new Map<string, string>();

/** What changed from what was known; and what is known from now on. */
export function compared(before: ReadonlyMap<string, string>, cameras: readonly { id: string; word: string; since: string; reason: string | null }[], now: number): Change[] {
  return cameras.flatMap(({ id, word, since, reason }) => {
    const from = before.get(id) ?? null;
    if (from === word) return [];
    // The daemon's word for since when, where it is one of the daemon's states.
    const told = Date.parse(since);
    return [{ camera: id, from, to: word, at: from === null && Number.isFinite(told) ? told : now, reason }];
  });
}

/** Watches from now on; answers how to end it. */
export function watchHealth(): () => void {
  return effect(() => {
    const cameras = state.cameras.value;
    if (!cameras) return;
    const isOld = state.areCamerasOld.value;
    const words = cameras.map((camera) => ({ id: camera.id, word: state.stateOf(camera, isOld), since: camera.since, reason: camera.reason }));
    const found = compared(known, words, Date.now());
    words.forEach(({ id, word }) => known.set(id, word));
    if (found.length > 0) changes.value = [...found, ...changes.peek()].slice(0, MOST_CHANGES);
  });
}
