// The requests of saving, each of which answers the tag that its part has now.

import { Trouble, api, change, content } from "../ask";
import type { DraftCamera, SceneDocument } from "./draft";
import { cameraDocument, putAsset, sceneDocument } from "./requests";

export { putCamera } from "./requests";
export { sceneDocument as sceneNow } from "./requests";

const scenePath = (id: string) => `/api/v1/scenes/${encodeURIComponent(id)}`;
const feedPath = (id: string) => `/api/v1/cameras/${encodeURIComponent(id)}/source`;

/** The document in its normal form; throws `Trouble` with every fault. */
export async function validate(id: string, document: SceneDocument): Promise<SceneDocument> {
  return (await change<{ document: SceneDocument }>("PUT", `${scenePath(id)}?validate_only=true`, document)).document;
}

export async function putScene(id: string, document: SceneDocument, tag: string | null): Promise<string | null> {
  const answer = await change<Response>("PUT", scenePath(id), document, { tag, raw: true });
  // What comes back may not name its tag; the one that is told when asked holds as well.
  return answer.headers.get("ETag") ?? (await sceneDocument(id))?.tag ?? null;
}

/** Changes what feeds a camera of the configuration. */
export async function patchFeed(id: string, patch: object, tag: string | null): Promise<string | null> {
  const answer = await change<Response>("PATCH", feedPath(id), patch, { ...(tag === null ? {} : { tag }), raw: true });
  return answer.headers.get("ETag");
}

export async function removeCamera(id: string, tag: string | null): Promise<void> {
  try {
    await change("DELETE", `/api/v1/cameras/${encodeURIComponent(id)}`, undefined, tag === null ? {} : { tag });
  } catch (error) {
    // It went already: the answer to an earlier attempt was lost.
    if (!(error instanceof Trouble) || error.status !== 404) throw error;
  }
}

/** A file goes under a name with its digest: what is there already is the same. */
export async function putFile(path: string, file: Blob): Promise<void> {
  try {
    await putAsset(path.slice(path.indexOf("/") + 1), file);
  } catch (error) {
    if (!(error instanceof Trouble) || error.status !== 412) throw error;
  }
}

/** What the daemon has of a camera now, with its tag. */
export async function cameraNow(camera: DraftCamera): Promise<{ camera: DraftCamera; tag: string | null } | null> {
  if (camera.origin !== "configured") return cameraDocument(camera.id);
  const response = await change<Response>("GET", feedPath(camera.id), undefined, { raw: true });
  const { enabled, source, clock } = (await response.json()) as { enabled: boolean; source: DraftCamera["source"]; clock: DraftCamera["clock"] };
  return { camera: { ...camera, isEnabled: enabled, source, clock }, tag: response.headers.get("ETag") };
}

/** Who changed a scene last, and when; null where that is not told. */
export async function lastChange(id: string): Promise<{ by: string | null; at: string } | null> {
  try {
    const { versions } = await content(api.GET("/api/v1/scenes/{id}/versions", { params: { path: { id }, query: { limit: 1 } } }));
    const [last] = versions;
    return last ? { by: last.changed_by ?? null, at: last.changed_at } : null;
  } catch {
    return null;
  }
}
