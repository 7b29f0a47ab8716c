// Pictures of sources that are not kept: what was looked at lately is remembered, so that a hand on the scrubber meets it again at once.

import type { Source } from "../draft";
import { type Newest, useNewest } from "../newest";
import { type Look, look } from "../requests";

const MOST_KEPT = 60;
/** As many as the daemon takes. One that is under way goes on though its picture is not wanted any more: to the daemon it would
 * go on all the same, and its picture may be met again. */
const AT_ONCE = 2;
const REST_MILLIS = 150;

export type Looked = Omit<Look, "picture_jpeg"> & { readonly url: string };

const kept = new Map<string, Looked>();

function pictureUrl(base64: string): string {
  const bytes = Uint8Array.from(atob(base64.replace(/^data:[^,]*,/, "")), (char) => char.charCodeAt(0));
  return URL.createObjectURL(new Blob([bytes], { type: "image/jpeg" }));
}

let underWay = 0;
const waiting: (() => void)[] = [];

/** Does one after the other; what is not wanted any more once it is its turn is not done. */
async function inTurn<Answer>(signal: AbortSignal, act: () => Promise<Answer>): Promise<Answer> {
  if (underWay >= AT_ONCE) await new Promise<void>((resolve) => waiting.push(resolve));
  underWay += 1;
  try {
    signal.throwIfAborted();
    return await act();
  } finally {
    underWay -= 1;
    waiting.shift()?.();
  }
}

/** One picture of a source, from memory where it was looked at lately. Throws `Trouble`. */
async function lookAt(key: string, source: Source, atSecs: number, signal: AbortSignal): Promise<Looked> {
  const before = kept.get(key);
  if (before) {
    // The newest stay.
    kept.delete(key);
    kept.set(key, before);
    return before;
  }
  const { picture_jpeg, ...facts } = await inTurn(signal, () => look(source, atSecs));
  const looked = { ...facts, url: pictureUrl(picture_jpeg) };
  kept.set(key, looked);
  const [oldest] = kept;
  if (kept.size > MOST_KEPT && oldest) {
    URL.revokeObjectURL(oldest[1].url);
    kept.delete(oldest[0]);
  }
  return looked;
}

/** Looks whenever source or time rest; nothing where there is no source. `round` asks again. */
export function useLook(source: Source | null, atSecs: number, round = 0): Newest<Looked> {
  const key = source && JSON.stringify([source, atSecs, round]);
  return useNewest(key, REST_MILLIS, (signal) => (source && key !== null ? lookAt(key, source, atSecs, signal) : Promise.reject(new Error("no source"))));
}
