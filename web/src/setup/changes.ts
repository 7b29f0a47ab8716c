// What a draft would change of what the daemon has, part by part: what is told beside Save, and what saving does.

import type { Base, Draft, DraftCamera, Source } from "./draft";

export type Changes = {
  /** Whether the scene's document differs, or is new. */
  readonly isScene: boolean;
  /** Cameras to make or to replace. */
  readonly put: readonly DraftCamera[];
  /** Cameras of the configuration whose source, clock or state is another. */
  readonly patch: readonly DraftCamera[];
  /** Ids of cameras to take away. */
  readonly remove: readonly string[];
};

/** Whether two values of JSON say the same, in whatever order their members stand; what is undefined is not there. */
export function equal(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (typeof a !== "object" || typeof b !== "object" || a === null || b === null || Array.isArray(a) !== Array.isArray(b)) return false;
  const [one, other] = [a as Record<string, unknown>, b as Record<string, unknown>];
  return [...new Set([...Object.keys(one), ...Object.keys(other)])].every((key) => equal(one[key], other[key]));
}

/** What is kept of a camera. Whether it was new when the draft began is not. */
function keptParts({ name, source, clock, isEnabled }: DraftCamera) {
  return { name, source, clock, isEnabled };
}

export function isSameCamera(a: DraftCamera, b: DraftCamera): boolean {
  return equal(keptParts(a), keptParts(b));
}

export function changes(draft: Draft, base: Base): Changes {
  const changed = draft.cameras.filter((camera) => {
    const before = base.cameras.find(({ id }) => id === camera.id);
    return !before || !isSameCamera(before, camera);
  });
  return {
    // A new scene in which nothing stands yet is none.
    isScene: !equal(draft.scene.document, base.scene ?? { version: 1 }),
    put: changed.filter(({ origin }) => origin !== "configured"),
    patch: changed.filter(({ origin }) => origin === "configured"),
    remove: base.cameras.filter(({ id }) => !draft.cameras.some((camera) => camera.id === id)).map(({ id }) => id),
  };
}

export function count({ isScene, put, patch, remove }: Changes): number {
  return (isScene ? 1 : 0) + put.length + patch.length + remove.length;
}

/** What turns one object into another as a merge patch (RFC 7396): null takes a member away. */
export function mergePatch(from: Readonly<Record<string, unknown>>, to: Readonly<Record<string, unknown>>): Record<string, unknown> {
  const patch: Record<string, unknown> = {};
  for (const key of new Set([...Object.keys(from), ...Object.keys(to)])) {
    if (!equal(from[key], to[key])) patch[key] = to[key] ?? null;
  }
  return patch;
}

/** What feeds a camera of the configuration otherwise than before. */
export function feedPatch(before: DraftCamera, after: DraftCamera): Record<string, unknown> {
  const source = mergePatch(before.source, after.source);
  const clock = mergePatch(before.clock, after.clock);
  return {
    ...(before.isEnabled === after.isEnabled ? {} : { enabled: after.isEnabled }),
    ...(Object.keys(source).length > 0 ? { source } : {}),
    ...(Object.keys(clock).length > 0 ? { clock } : {}),
  };
}

/** Scheme and host of a URL: of one with a port that is the scheme's own, the daemon's word differs from what was typed. */
function host(url: string): string {
  return (/^[a-z]+:\/\/(\[[^\]]*\]|[^/:?#]*)/i.exec(url)?.[0] ?? url).toLowerCase();
}

/** Whether the daemon shows a source as it was sent: of URLs it shows nothing behind the host, and what was left out as its default. */
function isShownAs(sent: Source, shown: Source): boolean {
  return Object.entries(sent).every(([key, value]) => {
    const told = shown[key];
    if (key === "url" && typeof told === "string" && typeof value === "string") return host(value) === host(told);
    return value === undefined || value === null || equal(value, told);
  });
}

/** Whether what the daemon shows of a camera is what was sent: then a change whose answer was lost has come. */
export function hasCome(sent: DraftCamera, shown: DraftCamera): boolean {
  const isClock = (sent.clock.offset_secs ?? 0) === (shown.clock.offset_secs ?? 0) && (sent.clock.drift_ppm ?? 0) === (shown.clock.drift_ppm ?? 0);
  return sent.name === shown.name && sent.isEnabled === shown.isEnabled && isClock && isShownAs(sent.source, shown.source);
}
