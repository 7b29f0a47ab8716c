// Small pictures of other times, for finding a place in time: few at once, and those that were seen are kept for a while.

import { ask } from "../ask";
import { instant } from "./moments";

const MOST_KEPT = 60;
const HEIGHT = 135;

export type Wish = { readonly scene: string; readonly camera: string | null; readonly millis: number; readonly beside: number; readonly view: Readonly<Record<string, string>> };

const kept = new Map<string, string | null>();

/** Times that are shown as one: as fine as a few pixels of the timeline. */
export function keyOf({ scene, camera, millis, beside, view }: Wish): string {
  return JSON.stringify([scene, camera, Math.round(millis / (beside * 2)), Math.round(beside), camera === null ? view : null]);
}

/** What is kept of a wish: a picture's address, null where there is none at that time, undefined where it must be asked for. */
export const known = (wish: Wish) => kept.get(keyOf(wish));

/** Asks for the picture of a wish. Answers null where there is none. */
export async function look(wish: Wish, signal: AbortSignal): Promise<string | null> {
  const { scene, camera, millis, beside, view } = wish;
  const response = camera === null
    ? await ask(`/api/v1/scenes/${encodeURIComponent(scene)}/view.jpg`, { ...view, t: instant(millis), width: (HEIGHT * 16) / 9, height: HEIGHT, quality: "draft" }, { signal })
    : await ask(`/api/v1/cameras/${encodeURIComponent(camera)}/strip.jpg`, { from: instant(millis - beside), to: instant(millis + beside), count: 1, height: HEIGHT }, { signal });
  const isThere = !/^(gap|unreadable|late)$/.test(response.headers.get("Videofields-Times") ?? "");
  const url = isThere ? URL.createObjectURL(await response.blob()) : null;
  keep(keyOf(wish), url);
  return url;
}

function keep(key: string, url: string | null): void {
  kept.set(key, url);
  for (const [oldest, picture] of kept) {
    if (kept.size <= MOST_KEPT) break;
    kept.delete(oldest);
    if (picture !== null) URL.revokeObjectURL(picture);
  }
}
