// What the daemon knows of a wall's screens, wherever they are, and what all of them are to show.

import { useEffect } from "preact/hooks";
import { signal } from "@preact/signals";
import { api, change, content } from "../ask";
import type { paths } from "../contract.gen";
import { type Learnt, useAsked } from "../parts/parts";
import type { Pattern } from "../screen/health";

export type Told = paths["/api/v1/walls/{id}/screens"]["get"]["responses"]["200"]["content"]["application/json"];
export type Screen = Told["screens"][number];

const AGAIN_MILLIS = 1_500;
/** How long a pattern stays. */
export const PATTERN_SECS = 300;

/** Patterns that were asked for since the daemon told last, by wall. */
const wished = signal<Readonly<Record<string, Pattern>>>({});

/** A wall's screens, again and again. */
export function useScreens(wall: string): Learnt<Told> {
  const learnt = useAsked(async () => {
    const told = await content(api.GET("/api/v1/walls/{id}/screens", { params: { path: { id: wall } } }));
    wished.value = Object.fromEntries(Object.entries(wished.peek()).filter(([of]) => of !== wall));
    return told;
  }, AGAIN_MILLIS, wall);
  useEffect(() => () => void (wished.value = {}), []);
  const wish = wished.value[wall];
  const { data } = learnt;
  return wish !== undefined && data ? { ...learnt, data: { ...data, pattern: { ...data.pattern, shows: wish } } } : learnt;
}

/** Has all screens of a wall show a pattern for a while, or their pictures again. Throws `Trouble`. */
export async function showPattern(wall: string, pattern: Pattern): Promise<void> {
  wished.value = { ...wished.value, [wall]: pattern };
  await change("PUT", `/api/v1/walls/${encodeURIComponent(wall)}/pattern`, { shows: pattern, seconds: PATTERN_SECS });
}

/** How many frames the screen that is farthest from the others is beside them; 0 of one alone. */
export function framesApart(screens: readonly Screen[]): number {
  const frames = screens.map(({ frame }) => frame).filter((frame) => frame !== null);
  return frames.length < 2 ? 0 : Math.max(...frames) - Math.min(...frames);
}

/** The page of a screen. */
export function screenPath(wall: string, tile: string): string {
  return `/wall?${new URLSearchParams({ wall, tile }).toString()}`;
}
