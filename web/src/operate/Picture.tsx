// The fused picture, drawn by the daemon or by this browser.

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { choice } from "./browser/choose";
import { FusedView } from "./FusedView";

/** Loaded when it is first wanted; until then the daemon draws. */
const Browser = signal<ComponentType | null>(null);

async function load(): Promise<void> {
  try {
    Browser.value = (await import("./browser/BrowserView")).default;
  } catch {
    // The daemon draws on; the next change tries again.
  }
}

export function Picture() {
  const { by } = choice.value;
  useEffect(() => {
    if (by === "browser" && !Browser.peek()) void load();
  }, [by]);
  return by === "browser" && Browser.value ? <Browser.value /> : <FusedView />;
}
