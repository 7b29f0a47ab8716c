// Where a draft begins: at what the daemon has of a scene and of all its cameras, or at nothing for a new scene.

import { signal } from "@preact/signals";
import { Trouble, api, content } from "../ask";
import * as state from "../operate/state";
import { session } from "../session";
import { areFilesUnkept, forgetFiles } from "./assets";
import { type Base, type Draft, type DraftCamera, type SceneDocument, begin, discard, isReadOnly, kept, resume } from "./draft";
import { changes, count } from "./changes";
import { found } from "./faults";
import { idFrom } from "./ids";
import { cameraDocument, sceneDocument } from "./requests";

export const EMPTY_SCENE: SceneDocument = { version: 1 };

/** A camera of the configuration; what feeds it is told only to who may manage it. */
async function configured(id: string, name: string): Promise<{ camera: DraftCamera; tag: string | null }> {
  const { data, response } = await api.GET("/api/v1/cameras/{id}/source", { params: { path: { id } } });
  const feed = data as { enabled?: boolean; source?: DraftCamera["source"]; clock?: DraftCamera["clock"] } | undefined;
  const camera = { id, name, source: feed?.source ?? {}, clock: feed?.clock ?? {}, isEnabled: feed?.enabled ?? true, origin: "configured" as const };
  return { camera, tag: response.ok ? response.headers.get("ETag") : null };
}

/** The tag of a camera of the configuration of which nothing was changed. */
const UNCHANGED = '"0"';

/** A camera as the daemon has it, whoever made it. */
async function camera(id: string, name: string): Promise<{ camera: DraftCamera; tag: string | null }> {
  // Viewers are not told what feeds cameras.
  if (session.value?.role === "viewer") return { camera: { id, name, source: {}, clock: {}, isEnabled: true, origin: "configured" }, tag: null };
  const feed = await configured(id, name);
  if (feed.tag === null || feed.tag.replace("-gzip", "") === UNCHANGED) return feed;
  try {
    const own = await cameraDocument(id);
    if (own) return { ...own, camera: { ...own.camera, name: own.camera.name || name } };
  } catch (error) {
    // Who may not change cameras is not told of their documents.
    if (!(error instanceof Trouble) || ![401, 403].includes(error.status)) throw error;
  }
  return feed;
}

async function cameras(): Promise<Pick<Base, "cameras" | "cameraTags">> {
  const told = await content(api.GET("/api/v1/cameras"));
  state.cameras.value = told.cameras;
  const found = await Promise.all(told.cameras.map(({ id, name }) => camera(id, name)));
  const tags = found.flatMap(({ camera, tag }) => (tag === null ? [] : [[camera.id, tag] as const]));
  return { cameras: found.map(({ camera }) => camera), cameraTags: Object.fromEntries(tags) };
}

/** When the draft that was taken up again was left, milliseconds since 1970; null of one that began here. */
export const takenUp = signal<number | null>(null);

/** Begins at a scene that the daemon has; at a new one where `id` is null. What was clicked to calibrate cameras may be carried on.
 * Throws `Trouble`. */
export async function beginWith(id: string | null, calibrating: Draft["calibrating"] = {}): Promise<void> {
  const [of, scene] = await Promise.all([cameras(), id === null ? null : sceneDocument(id)]);
  const taken = (state.scenes.value ?? []).map((known) => known.id);
  const document = scene?.document ?? EMPTY_SCENE;
  found.value = [];
  takenUp.value = null;
  begin(
    { scene: { id: id ?? idFrom("", taken, "site"), document }, cameras: of.cameras, removedCameras: [], calibrating },
    { sceneTag: scene?.tag ?? null, scene: scene ? document : null, ...of },
  );
}

/** Whether the draft is about to be another: what is typed meanwhile would be lost with the old one. */
export const isBeginning = signal(false);

/** Lets go of the draft and its files, and begins anew at what the daemon has. */
export async function beginAnew(id: string | null): Promise<void> {
  isBeginning.value = true;
  try {
    await forgetFiles();
    areFilesUnkept.value = false;
    discard();
    await beginWith(id);
  } finally {
    isBeginning.value = false;
  }
}

/** The scenes of the daemon, asked for anew. */
export async function learnScenes(): Promise<state.Scene[]> {
  const { scenes } = await content(api.GET("/api/v1/scenes"));
  state.scenes.value = scenes;
  return scenes;
}

/** Takes up what this browser kept, else begins at the scene that is asked for, or at the first. */
export async function start(wanted: string | undefined): Promise<void> {
  const before = isReadOnly.value ? null : kept();
  if (before && count(changes(before.draft, before.base)) > 0 && resume()) {
    takenUp.value = before.at;
    return;
  }
  const scenes = await learnScenes();
  const known = [wanted, before?.draft.scene.id].find((id) => scenes.some((scene) => scene.id === id));
  const isSame = known !== undefined && known === before?.draft.scene.id;
  await beginWith(known ?? scenes[0]?.id ?? null, isSame ? before.draft.calibrating : {});
}
