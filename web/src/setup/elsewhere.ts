// The same browser has one draft: whether another of its tabs changes it too.

import { signal } from "@preact/signals";
import { KEPT } from "./draft";

export const isOpenElsewhere = signal(false);

/** Watches until what it answers is called. */
export function watchElsewhere(): () => void {
  // The browser tells only of what other tabs do.
  const onStorage = ({ key, newValue }: StorageEvent) => {
    if (key === KEPT && newValue !== null) isOpenElsewhere.value = true;
  };
  addEventListener("storage", onStorage);
  return () => removeEventListener("storage", onStorage);
}
