// How a screen fares: what is counted of its frames, and what stands in its corner on demand.

import type { components } from "../contract.gen";
import { say } from "../strings";

export type Pattern = components["schemas"]["WallPattern"]["shows"];
/** What the daemon is told. */
export type Told = components["schemas"]["ScreenHealth"];

/** How a screen fares, as it says itself; times in milliseconds. */
export type Health = {
  readonly wall: string;
  readonly tile: string;
  /** Number of the frame that is shown; null before the first. */
  readonly frame: number | null;
  readonly ageMillis: number | null;
  readonly rate: number;
  readonly wantedRate: number;
  readonly late: number;
  readonly missed: number;
  readonly unreadable: number;
  readonly reconnects: number;
  readonly offsetMillis: number | null;
  readonly way: "socket" | "pull" | "none";
};

/** As the daemon takes it. */
export function told({ frame, ageMillis, rate, missed, late, unreadable, reconnects, offsetMillis }: Health): Told {
  const secs = (millis: number | null) => (millis === null ? null : millis / 1e3);
  return { frame, age_secs: secs(ageMillis), rate_hz: rate, missed, late, unreadable, reconnects, clock_offset_secs: secs(offsetMillis) };
}

/** Frames of the last seconds tell the rate. */
const RATE_MILLIS = 4_000;

/** A frame that is shown; times of this machine's clock, milliseconds. */
export type Shown = { readonly number: number; readonly version: string; readonly rate: number; readonly at: number };

export type Counts = {
  readonly newest: Shown | null;
  /** When frames were shown lately. */
  readonly lately: readonly number[];
  /** Frames whose number was passed over. */
  readonly missed: number;
  /** Frames that were shown more than a frame's time after they should have been. */
  readonly late: number;
  readonly unreadable: number;
  readonly reconnects: number;
};

export const NOTHING: Counts = { newest: null, lately: [], missed: 0, late: 0, unreadable: 0, reconnects: 0 };

/** Counts a frame that was shown; `lateBy` is how long after it should have been, milliseconds. */
export function counted(counts: Counts, shown: Shown, lateBy: number): Counts {
  const { newest } = counts;
  const gap = newest && newest.version === shown.version ? Math.max(shown.number - newest.number - 1, 0) : 0;
  const isLate = shown.rate > 0 && lateBy > 1e3 / shown.rate;
  return {
    ...counts, newest: shown,
    lately: [...counts.lately, shown.at].filter((at) => shown.at - at <= RATE_MILLIS),
    missed: counts.missed + gap, late: counts.late + (isLate ? 1 : 0),
  };
}

/** Frames a second over the last seconds. */
export function rateOf({ lately }: Counts, now: number): number {
  const recent = lately.filter((at) => now - at <= RATE_MILLIS);
  const [first] = recent;
  const last = recent.at(-1);
  return first === undefined || last === undefined || last <= first ? 0 : (recent.length - 1) / ((last - first) / 1e3);
}

/** What screens wait where their address does not say, and at most; milliseconds. */
const MOST_USUAL_MILLIS = 250;
const MOST_MILLIS = 2_000;

/** How long after it was due a frame is shown, so that screens on unlike networks change at once: as `asked`, else a frame's time. */
export function delayOf(asked: string | null, rate: number): number {
  if (rate <= 0) return 0;
  return asked === null ? Math.min(1e3 / rate, MOST_USUAL_MILLIS) : Math.min(Math.max(Number(asked) || 0, 0), MOST_MILLIS);
}

/** What the screens of a wall that are heard here say together: how many, and how many frames the farthest is from this one. */
export function together(own: number | null, others: readonly { readonly frame: number | null }[]): { n: number; apart: number } {
  const frames = others.map(({ frame }) => frame).filter((frame) => frame !== null);
  const apart = own === null ? 0 : Math.max(0, ...frames.map((frame) => Math.abs(frame - own)));
  return { n: frames.length, apart };
}

type Row = readonly [string, string];

/** What stands in the corner. */
export function rows(health: Health, behindMillis: number | null, lock: { n: number; apart: number }): Row[] {
  const millis = (value: number | null) => (value === null ? "–" : say("screen.health.millis", { n: Math.round(value) }));
  const inStep = lock.n === 0 ? say("screen.health.lock.none")
    : lock.apart <= 1 ? say("screen.health.lock.in", { n: lock.n }) : say("screen.health.lock.out", { n: lock.n, frames: lock.apart });
  return [
    [say("screen.health.tile"), `${health.wall} ${health.tile}`],
    [say("screen.health.frame"), health.frame === null ? "–" : String(health.frame)],
    [say("screen.health.age"), millis(health.ageMillis)],
    [say("screen.health.behind"), millis(behindMillis)],
    [say("screen.health.rate"), say("screen.health.rate.of", { rate: health.rate.toFixed(1), wanted: health.wantedRate })],
    [say("screen.health.missed"), `${health.missed}, ${health.late}, ${health.unreadable}`],
    [say("screen.health.lock"), inStep],
    [say("screen.health.reconnects"), String(health.reconnects)],
    [say("screen.health.offset"), millis(health.offsetMillis)],
    [say("screen.health.way"), say(`screen.health.way.${health.way}`)],
  ];
}

/** Writes the corner. */
export function draw(corner: HTMLElement, told: readonly Row[]): void {
  const [title, list, keys] = [document.createElement("h1"), document.createElement("dl"), document.createElement("p")];
  title.textContent = say("screen.health");
  keys.textContent = say("screen.health.keys");
  for (const [name, value] of told) {
    const [term, detail] = [document.createElement("dt"), document.createElement("dd")];
    [term.textContent, detail.textContent] = [name, value];
    list.append(term, detail);
  }
  corner.replaceChildren(title, list, keys);
}
