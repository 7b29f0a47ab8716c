// What the screens of this browser say of themselves, and what they are told.

import { signal } from "@preact/signals";
import { type Health, type Pattern, openChannel } from "../screen/channel";

/** Who was not heard for so long has gone. */
const GONE_MILLIS = 4_000;

type Heard = { readonly health: Health; readonly at: number };

/** By page; newest word of each. */
export const heard = signal<ReadonlyMap<string, Heard>>(new Map());
let tell: ReturnType<typeof openChannel>["tell"] = () => {};

/** Listens as long as the place is open; answers how to end it. */
export function listen(): () => void {
  const channel = openChannel((message) => {
    const next = new Map(heard.value);
    if (message.kind === "health") next.set(message.health.page, { health: message.health, at: performance.now() });
    else if (message.kind === "gone") next.delete(message.page);
    else return;
    heard.value = next;
  });
  ({ tell } = channel);
  const sweep = setInterval(() => {
    const kept = [...heard.value].filter(([, { at }]) => performance.now() - at < GONE_MILLIS);
    if (kept.length < heard.value.size) heard.value = new Map(kept);
  }, 1_000);
  return () => {
    clearInterval(sweep);
    channel.close();
    heard.value = new Map();
  };
}

/** Has all screens of a wall in this browser show a pattern, or their pictures again. */
export function showPattern(wall: string, pattern: Pattern): void {
  tell({ kind: "pattern", wall, pattern });
}

/** The page of a screen. */
export function screenPath(wall: string, tile: string): string {
  return `/wall?${new URLSearchParams({ wall, tile }).toString()}`;
}
