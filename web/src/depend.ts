// Says what an effect or a part of a page hangs on where it does not read it otherwise.

import type { ReadonlySignal } from "@preact/signals";

/** What runs this runs again when one of these changes. */
export function dependOn(...signals: readonly ReadonlySignal<unknown>[]): void {
  signals.forEach((signal) => signal.value);
}
