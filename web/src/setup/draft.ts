// What is being set up and not kept yet: a scene's document, the cameras that are to be added or changed, and the pairs that were
// clicked. Every change is a step that can be undone; everything survives a reload in this browser; nothing reaches the daemon until
// it is asked for (`save.ts`).

import { computed, effect, signal } from "@preact/signals";
import type { components } from "../contract.gen";
import type { Point } from "../operate/orbit";

export type SceneDocument = components["schemas"]["Scene"];
export type Calibration = components["schemas"]["Calibration"];

/** A place in a camera's picture (pixels of the calibration's size, from the upper left corner) and where it lies in the world. */
export type Pair = { readonly picture_px: readonly [number, number]; readonly place_m: Point };
/** A line in a picture that runs along one of the world's axes. */
export type AxisLine = { readonly axis: "x" | "y" | "z"; readonly ends_px: readonly [readonly [number, number], readonly [number, number]] };

/** The keys of [camera.source] that the pages set; others are kept as they came. */
export type Source = {
  readonly path?: string; readonly url?: string; readonly device?: string;
  readonly from_secs?: number; readonly until_secs?: number; readonly end?: "stop" | "loop"; readonly pace?: "real_time" | "all"; readonly start?: string;
  readonly timing?: "pts" | "index"; readonly rate_hz?: number; readonly transport?: "tcp" | "udp"; readonly credentials?: string;
  readonly [key: string]: unknown;
};

/** A camera as it is to be. */
export type DraftCamera = {
  readonly id: string;
  readonly name: string;
  readonly source: Source;
  readonly clock: { readonly offset_secs?: number; readonly drift_ppm?: number; readonly since?: string | null };
  readonly isEnabled: boolean;
  /** How its foreground is found: not changed here, and sent back as it came. */
  readonly segment?: Readonly<Record<string, unknown>>;
  /** `configured` cameras stand in the configuration file: here only their clock and source can be changed. */
  readonly origin: "new" | "kept" | "configured";
};

/** How a camera is being calibrated. The calibration itself stands in the scene's document. */
export type Calibrating = {
  readonly pairs: readonly Pair[];
  readonly lines: readonly AxisLine[];
  readonly findsFocal: boolean;
  readonly findsK1: boolean;
};

export type Draft = {
  readonly scene: { readonly id: string; readonly document: SceneDocument };
  readonly cameras: readonly DraftCamera[];
  /** Ids of cameras that are to be taken away. */
  readonly removedCameras: readonly string[];
  readonly calibrating: Readonly<Record<string, Calibrating>>;
};

/** What the daemon had when the draft began, to tell what was changed and to change it with its tags. */
export type Base = {
  readonly sceneTag: string | null;
  readonly scene: SceneDocument | null;
  readonly cameras: readonly DraftCamera[];
  readonly cameraTags: Readonly<Record<string, string>>;
};

type Step = { readonly label: string; readonly draft: Draft };
type History = { readonly past: readonly Step[]; readonly now: Step; readonly future: readonly Step[] };

/** Steps that can be undone. */
const MOST_STEPS = 200;
/** Changes under one key this close together are one step: a drag, typing. */
const MERGE_MILLIS = 1_000;
/** Under which the browser keeps the draft. */
export const KEPT = "videofields.setup";
const KEEP_MILLIS = 300;

const history = signal<History | null>(null);
/** What the daemon had; null until a draft is begun. */
export const base = signal<Base | null>(null);
/** The draft as it stands; null until one is begun. */
export const draft = computed(() => history.value?.now.draft ?? null);
/** The label of what undo would take back, and redo bring again; null where there is nothing. */
export const undoable = computed(() => (history.value && history.value.past.length > 0 ? history.value.now.label : null));
export const redoable = computed(() => history.value?.future[0]?.label ?? null);

/** Whether who looks may not change anything: then no change is taken, and nothing is kept. */
export const isReadOnly = signal(false);

let merging: { key: string; at: number } | null = null;

/** Begins a draft, and forgets the one before. */
export function begin(from: Draft, of: Base): void {
  merging = null;
  base.value = of;
  history.value = { past: [], now: { label: "", draft: from }, future: [] };
}

/** Changes the draft as one step, named for people; changes under the same `mergeKey` shortly after one another are one step. */
export function edit(label: string, change: (draft: Draft) => Draft, mergeKey?: string): void {
  const before = history.value;
  if (!before || isReadOnly.value) return;
  const next = change(before.now.draft);
  if (next === before.now.draft) return;
  const now = performance.now();
  const isMerged = mergeKey !== undefined && merging?.key === mergeKey && now - merging.at < MERGE_MILLIS;
  merging = mergeKey === undefined ? null : { key: mergeKey, at: now };
  const past = isMerged ? before.past : [...before.past, before.now].slice(-MOST_STEPS);
  history.value = { past, now: { label, draft: next }, future: [] };
}

/** Ends the merging of changes: the next one is a step of its own. */
export function settle(): void {
  merging = null;
}

export function undo(): void {
  const of = history.value;
  const last = of?.past.at(-1);
  if (!of || !last) return;
  merging = null;
  history.value = { past: of.past.slice(0, -1), now: last, future: [of.now, ...of.future] };
}

export function redo(): void {
  const of = history.value;
  const [next, ...rest] = of?.future ?? [];
  if (!of || !next) return;
  merging = null;
  history.value = { past: [...of.past, of.now], now: next, future: rest };
}

/** Shorthand: changes the scene's document. */
export function editScene(label: string, change: (document: SceneDocument) => SceneDocument, mergeKey?: string): void {
  edit(label, (of) => {
    const document = change(of.scene.document);
    return document === of.scene.document ? of : { ...of, scene: { ...of.scene, document } };
  }, mergeKey);
}

/** Shorthand: changes one camera of the draft. */
export function editCamera(id: string, label: string, change: (camera: DraftCamera) => DraftCamera, mergeKey?: string): void {
  edit(label, (of) => ({ ...of, cameras: of.cameras.map((camera) => (camera.id === id ? change(camera) : camera)) }), mergeKey);
}

const NO_CALIBRATING: Calibrating = { pairs: [], lines: [], findsFocal: true, findsK1: false };

/** How a camera is being calibrated; nothing clicked yet where it is not. */
export function calibratingOf(of: Draft, camera: string): Calibrating {
  return of.calibrating[camera] ?? NO_CALIBRATING;
}

export function editCalibrating(camera: string, label: string, change: (of: Calibrating) => Calibrating, mergeKey?: string): void {
  edit(label, (of) => ({ ...of, calibrating: { ...of.calibrating, [camera]: change(calibratingOf(of, camera)) } }), mergeKey);
}

/** The calibration that the draft has of a camera; null where it has none (or one that is read from a file). */
export function calibrationOf(of: Draft, camera: string): Calibration | null {
  const found = of.scene.document.cameras?.find(({ id }) => id === camera)?.calibration;
  return found && "focal_px" in found ? found : null;
}

/** Gives a camera a calibration, or takes it out of the scene. */
export function setCalibration(camera: string, calibration: Calibration | null, label: string, mergeKey?: string): void {
  editScene(label, (document) => {
    const before = document.cameras ?? [];
    if (!calibration) return { ...document, cameras: before.filter(({ id }) => id !== camera) };
    const own = { id: camera, calibration };
    const isThere = before.some(({ id }) => id === camera);
    return { ...document, cameras: isThere ? before.map((other) => (other.id === camera ? own : other)) : [...before, own] };
  }, mergeKey);
}

/** Whether anything differs from what the daemon had. */
export const isDirty = computed(() => {
  const [now, of] = [draft.value, base.value];
  if (!now || !of) return false;
  return now.removedCameras.length > 0 || JSON.stringify([now.scene.document, now.cameras]) !== JSON.stringify([of.scene, of.cameras]);
});

/** `at`: when it was left, milliseconds since 1970. */
type Kept = { readonly base: Base; readonly draft: Draft; readonly at: number };

/** The draft that this browser kept; null where there is none that can be read. */
export function kept(): Kept | null {
  try {
    const read = JSON.parse(localStorage.getItem(KEPT) ?? "null") as Partial<Kept> | null;
    // What another version of the pages kept may be anything.
    return read?.base && read.draft && "scene" in read.draft && "cameras" in read.draft ? { base: read.base, draft: read.draft, at: read.at ?? 0 } : null;
  } catch {
    return null;
  }
}

/** Takes up the draft that was kept; false where there is none. */
export function resume(): boolean {
  const found = kept();
  if (found) begin(found.draft, found.base);
  return found !== null;
}

/** Forgets the draft, here and in the browser. */
export function discard(): void {
  [history.value, base.value, merging] = [null, null, null];
  try {
    localStorage.removeItem(KEPT);
  } catch {
    // Then there was nothing kept.
  }
}

/** Whether the browser could not keep the draft: it would be lost with the page. */
export const isUnkept = signal(false);

let keeping: ReturnType<typeof setTimeout> | undefined;

function keep(): void {
  clearTimeout(keeping);
  const [now, of] = [draft.value, base.value];
  if (!now || !of || isReadOnly.value) return;
  try {
    localStorage.setItem(KEPT, JSON.stringify({ base: of, draft: now, at: Date.now() } satisfies Kept));
    isUnkept.value = false;
  } catch {
    isUnkept.value = true;
  }
}

effect(() => {
  if (!draft.value || !base.value) return;
  clearTimeout(keeping);
  keeping = setTimeout(keep, KEEP_MILLIS);
});
// Typing and reloading at once must lose nothing.
if (typeof addEventListener !== "undefined") addEventListener("pagehide", keep);
