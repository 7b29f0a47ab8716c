// Whether the daemon answers. While it is silent somebody asks it again and again, so that the page goes on by itself.

import { signal } from "@preact/signals";

const AGAIN_MILLIS = 1_500;
const USUAL_MILLIS = 10_000;

/** Since when nothing was answered (of `performance.now()`); null while all is well. */
export const lostSince = signal<number | null>(null);
let heardAt = performance.now();

/** Notes an answer, whatever it was. */
export function answered(): void {
  heardAt = performance.now();
  if (lostSince.value !== null) lostSince.value = null;
}

/** Notes that a question was not answered. */
export function silent(): void {
  lostSince.value ??= heardAt;
}

/** Asks as long as the page is open whether the daemon is there, where nobody else does. */
export async function watch(): Promise<never> {
  for (;;) {
    const pause = lostSince.value === null ? USUAL_MILLIS : AGAIN_MILLIS;
    await new Promise((resolve) => setTimeout(resolve, pause));
    if (document.hidden || performance.now() - heardAt < pause) continue;
    try {
      await fetch("/healthz", { cache: "no-store", signal: AbortSignal.timeout(5_000) });
      answered();
    } catch {
      silent();
    }
  }
}
