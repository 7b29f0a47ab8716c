// Saving a draft: the daemon is asked whether the scene is right, then every part goes there by itself: files, cameras, the scene, and
// last what is to go. What the daemon acknowledges becomes the draft's base at once, so that saving again after a lost connection goes
// on where it stopped. What somebody else changed meanwhile is never replaced unasked.

import { signal } from "@preact/signals";
import { Trouble, told } from "../ask";
import { fileOf, forgetFiles, namedFiles } from "./assets";
import { changes, equal, feedPatch, hasCome } from "./changes";
import { type Base, type Draft, type DraftCamera, type SceneDocument, base, draft, edit, editScene } from "./draft";
import { type Fault, found, placed } from "./faults";
import * as daemon from "./saving";
import { hasPlace } from "./stages";
import { say } from "../strings";
import { without } from "./without";

export type Conflict = {
  readonly kind: "scene" | "camera";
  readonly id: string;
  /** What the daemon has now; null where it is gone. */
  readonly theirs: SceneDocument | DraftCamera | null;
  readonly tag: string | null;
  readonly by: string | null;
  readonly at: string | null;
};

export type Result =
  | { readonly kind: "saved"; readonly at: number }
  | { readonly kind: "faults" }
  | { readonly kind: "conflict"; readonly conflict: Conflict }
  | { readonly kind: "failed"; readonly message: string };

/** What is being done; null while nothing is saved. */
export const saving = signal<string | null>(null);
/** What came of the last saving; null until there was one. */
export const result = signal<Result | null>(null);

/** Ends a saving: with what somebody else did meanwhile, or with faults. */
class Stop extends Error {
  constructor(readonly result: Result) {
    super(result.kind);
  }
}

function acknowledge(change: (of: Base) => Base): void {
  if (base.value) base.value = change(base.value);
}

/** Takes over what the daemon now has of a camera. */
function keptCamera(camera: DraftCamera, tag: string | null): void {
  acknowledge((of) => {
    const isThere = of.cameras.some(({ id }) => id === camera.id);
    const cameras = isThere ? of.cameras.map((other) => (other.id === camera.id ? camera : other)) : [...of.cameras, camera];
    const others = without(of.cameraTags, camera.id);
    return { ...of, cameras, cameraTags: tag === null ? others : { ...others, [camera.id]: tag } };
  });
}

function goneCamera(id: string): void {
  acknowledge((of) => ({ ...of, cameras: of.cameras.filter((camera) => camera.id !== id), cameraTags: without(of.cameraTags, id) }));
}

/** What the page can see by itself. */
function ownFaults(of: Draft): Fault[] {
  return changes(of, base.value ?? { sceneTag: null, scene: null, cameras: [], cameraTags: {} }).put
    .filter((camera) => !hasPlace(camera))
    .map((camera) => {
      const field = (["url", "device"] as const).find((kind) => kind in camera.source) ?? "path";
      return placed(of, { kind: "camera", id: camera.id }, { pointer: `/source/${field}`, detail: say(`setup.fault.${field}`) });
    });
}

function stopAt(faults: readonly Fault[]): never {
  found.value = faults;
  throw new Stop({ kind: "faults" });
}

/** What a refused part says, as faults at their places. */
function faultsOf(of: Draft, document: Parameters<typeof placed>[1], error: unknown): Fault[] | null {
  if (!(error instanceof Trouble) || error.status === 412) return null;
  if (error.faults.length === 0 && ![400, 409, 413, 422].includes(error.status)) return null;
  const faults = error.faults.length > 0 ? error.faults : [{ detail: error.message }];
  return faults.map((fault) => placed(of, document, fault));
}

async function sendFiles(of: Draft): Promise<void> {
  const paths = namedFiles(of.scene.document);
  for (const path of paths) {
    const file = await fileOf(path);
    if (!file) continue;
    saving.value = say("setup.saving.file", { name: path });
    await daemon.putFile(path, file);
    await forgetFiles([path]);
  }
}

async function sendCamera(of: Draft, camera: DraftCamera): Promise<void> {
  saving.value = say("setup.saving.camera", { name: camera.name || camera.id });
  const now = base.value;
  const before = now?.cameras.find(({ id }) => id === camera.id);
  const tag = now?.cameraTags[camera.id] ?? null;
  try {
    const isConfigured = camera.origin === "configured" && before !== undefined;
    keptCamera(camera, isConfigured ? await daemon.patchFeed(camera.id, feedPatch(before, camera), tag) : await daemon.putCamera(camera, tag));
  } catch (error) {
    const faults = faultsOf(of, { kind: "camera", id: camera.id }, error);
    if (faults) stopAt(faults);
    if (!(error instanceof Trouble) || error.status !== 412) throw error;
    const theirs = await daemon.cameraNow(camera);
    // A change whose answer was lost is there already.
    if (theirs && hasCome(camera, theirs.camera)) {
      keptCamera(camera, theirs.tag);
      return;
    }
    const conflict = { kind: "camera", id: camera.id, theirs: theirs?.camera ?? null, tag: theirs?.tag ?? null, by: null, at: null } as const;
    throw new Stop({ kind: "conflict", conflict });
  }
}

async function dropCamera(id: string): Promise<void> {
  saving.value = say("setup.saving.remove", { name: id });
  try {
    await daemon.removeCamera(id, base.value?.cameraTags[id] ?? null);
    goneCamera(id);
  } catch (error) {
    if (!(error instanceof Trouble) || error.status !== 412) throw error;
    const before = base.value?.cameras.find((camera) => camera.id === id);
    const theirs = before ? await daemon.cameraNow(before) : null;
    if (!theirs) {
      goneCamera(id);
      return;
    }
    throw new Stop({ kind: "conflict", conflict: { kind: "camera", id, theirs: theirs.camera, tag: theirs.tag, by: null, at: null } });
  }
}

/** The scene as somebody else left it. */
async function sceneConflict(id: string): Promise<Conflict> {
  const [theirs, last] = await Promise.all([daemon.sceneNow(id), daemon.lastChange(id)]);
  return { kind: "scene", id, theirs: theirs?.document ?? null, tag: theirs?.tag ?? null, by: last?.by ?? null, at: last?.at ?? null };
}

async function sendScene({ scene: { id, document } }: Draft, normal: SceneDocument): Promise<void> {
  saving.value = say("setup.saving.scene");
  const kept = (tag: string | null) => acknowledge((of) => ({ ...of, scene: document, sceneTag: tag }));
  try {
    kept(await daemon.putScene(id, document, base.value?.sceneTag ?? null));
  } catch (error) {
    if (!(error instanceof Trouble) || error.status !== 412) throw error;
    const conflict = await sceneConflict(id);
    if (!conflict.theirs || !equal(conflict.theirs, normal)) throw new Stop({ kind: "conflict", conflict });
    kept(conflict.tag);
  }
}

async function saveAll(of: Draft): Promise<void> {
  const own = ownFaults(of);
  if (own.length > 0) stopAt(own);
  const { isScene, put, patch, remove } = changes(of, base.value ?? { sceneTag: null, scene: null, cameras: [], cameraTags: {} });
  let normal: SceneDocument | null = null;
  if (isScene) {
    await sendFiles(of);
    saving.value = say("setup.saving.check");
    try {
      normal = await daemon.validate(of.scene.id, of.scene.document);
    } catch (error) {
      const faults = faultsOf(of, { kind: "scene" }, error);
      if (faults) stopAt(faults);
      throw error;
    }
  }
  for (const camera of [...put, ...patch]) await sendCamera(of, camera);
  if (normal) await sendScene(of, normal);
  for (const id of remove) await dropCamera(id);
  // In the draft's order, so that nothing seems changed.
  acknowledge((now) => ({ ...now, cameras: of.cameras.flatMap(({ id }) => now.cameras.filter((camera) => camera.id === id)) }));
}

/** Saves the draft as it stands; what comes of it stands in `result`. */
export async function save(): Promise<void> {
  const of = draft.value;
  if (!of || saving.value !== null) return;
  [saving.value, result.value, found.value] = [say("setup.saving.check"), null, []];
  try {
    await saveAll(of);
    result.value = { kind: "saved", at: Date.now() };
  } catch (error) {
    result.value = error instanceof Stop ? error.result : { kind: "failed", message: told(error) };
  } finally {
    saving.value = null;
  }
}

/** Whether the daemon's scene is another than when the draft began; null where it is not. */
export async function changedMeanwhile(): Promise<Conflict | null> {
  const [of, from] = [draft.value, base.value];
  if (!of || !from || from.sceneTag === null) return null;
  const now = await daemon.sceneNow(of.scene.id);
  const plain = (tag: string | null | undefined) => tag?.replace(/-gzip(?="$)/, "");
  return plain(now?.tag) === plain(from.sceneTag) ? null : sceneConflict(of.scene.id);
}

/** From now on the draft is held against theirs: saving again puts mine over it. */
export function keepMine({ kind, id, theirs, tag }: Conflict): void {
  if (kind === "scene") acknowledge((of) => ({ ...of, sceneTag: tag, scene: theirs as SceneDocument | null }));
  else if (theirs) keptCamera(theirs as DraftCamera, tag);
  else goneCamera(id);
  result.value = null;
}

/** Takes theirs into the draft, as a step: undo brings mine back. */
export function takeTheirs(conflict: Conflict): void {
  const { kind, id, theirs } = conflict;
  if (!theirs) return;
  keepMine(conflict);
  const label = say("setup.step.theirs");
  if (kind === "scene") editScene(label, () => theirs as SceneDocument);
  else edit(label, (of) => ({ ...of, cameras: [...of.cameras.filter((camera) => camera.id !== id), theirs as DraftCamera] }));
}
