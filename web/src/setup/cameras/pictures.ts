// The chosen camera's picture: live, held still, or without people; of a camera that is not kept yet, a look at its source.

import { signal } from "@preact/signals";
import { Trouble, ask, told } from "../../ask";
import { pauser, seen } from "../../pause";
import { CameraTexture, decoded } from "../../spatial/cameraTextures";
import type { DraftCamera } from "../draft";
import { look } from "../requests";
import { isRunning, pictureSizes } from "./now";
import type { Pixel } from "./pairs";

export const SHOWINGS = ["background", "live", "held"] as const;
export type Showing = (typeof SHOWINGS)[number];

export type Shown = {
  readonly camera: string;
  readonly url: string;
  readonly size: Pixel;
};

const LIVE_MILLIS = 400;
const BACKGROUND_MILLIS = 10_000;
const AFTER_TROUBLE_MILLIS = 2_000;

export const showing = signal<Showing>("background");
/** Which second of a source that is not kept yet is looked at, and how many it has. */
export const lookAt = signal(0);
export const lookLength = signal<number | null>(null);
/** What is shown; null until there is something. */
export const picture = signal<Shown | null>(null);
/** Counts pictures that surfaces are to show anew. */
export const textureChanged = signal(0);
export const trouble = signal<string | null>(null);

/** The same picture, for surfaces; another one for another camera. */
export const texture = signal<CameraTexture | null>(null);

/** Puts a picture in the place of the one before. */
async function put(camera: string, blob: Blob, isOver: () => boolean): Promise<void> {
  const url = URL.createObjectURL(blob);
  const image = new Image();
  image.src = url;
  const [bitmap] = await Promise.all([decoded(blob), image.decode()]);
  if (isOver()) {
    bitmap.close();
    URL.revokeObjectURL(url);
    return;
  }
  const size: Pixel = [image.naturalWidth, image.naturalHeight];
  const before = picture.value;
  picture.value = { camera, url, size };
  texture.value?.set(bitmap);
  if (pictureSizes.value[camera]?.join() !== size.join()) pictureSizes.value = { ...pictureSizes.value, [camera]: size };
  trouble.value = null;
  // What is drawn with it in this frame may still ask for it.
  if (before) setTimeout(() => URL.revokeObjectURL(before.url), 2_000);
}

function bytes(base64: string): Blob {
  const text = atob(base64.replace(/^data:[^,]*,/, ""));
  return new Blob([Uint8Array.from(text, (letter) => letter.charCodeAt(0))], { type: "image/jpeg" });
}

/** Shows a camera's pictures until the answer is called; changes of `showing` and `lookAt` begin it anew (the caller sees to that). */
export function follow(camera: DraftCamera): () => void {
  const ending = new AbortController();
  const isOver = () => ending.signal.aborted;
  const { pause, wake } = pauser();
  if (!texture.value || picture.value?.camera !== camera.id) {
    texture.value?.dispose();
    texture.value = new CameraTexture(() => (textureChanged.value = textureChanged.peek() + 1));
    picture.value = null;
  }
  trouble.value = null;
  const once = isRunning(camera) ? () => fromDaemon(camera.id) : () => fromSource(camera);
  let tag: string | null = null;

  async function fromDaemon(id: string): Promise<number> {
    const path = (kind: string) => `/api/v1/cameras/${encodeURIComponent(id)}/${kind}.jpg`;
    const isBackground = showing.value === "background";
    const found = await ask(path(isBackground ? "background" : "frame"), {}, { signal: ending.signal, tag }).catch((error: unknown) => {
      // A camera that has just begun knows no background yet; its frame will do until then.
      if (isBackground && error instanceof Trouble && error.status !== 0) return null;
      throw error;
    });
    const isMissing = found === null;
    const response = found ?? (await ask(path("frame"), {}, { signal: ending.signal }));
    if (response.status !== 304) {
      tag = isMissing ? null : response.headers.get("ETag");
      await put(id, await response.blob(), isOver);
    }
    if (showing.value === "held") return Infinity;
    if (isMissing) return AFTER_TROUBLE_MILLIS;
    return showing.value === "live" ? LIVE_MILLIS : BACKGROUND_MILLIS;
  }

  async function fromSource({ id, source }: DraftCamera): Promise<number> {
    const told = await look(source, lookAt.value, ending.signal);
    if (isOver()) return Infinity;
    lookLength.value = told.duration_secs;
    await put(id, bytes(told.picture_jpeg), isOver);
    return Infinity;
  }

  void (async () => {
    while (!isOver()) {
      await seen();
      const wait = await once().catch((error: unknown) => {
        if (!isOver()) trouble.value = told(error);
        return AFTER_TROUBLE_MILLIS;
      });
      if (wait === Infinity || isOver()) return;
      await pause(wait);
    }
  })();
  return () => {
    ending.abort();
    wake();
  };
}

/** Lets go of what surfaces show. */
export function forget(): void {
  texture.value?.dispose();
  [texture.value, picture.value] = [null, null];
}
