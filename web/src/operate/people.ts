// People and things that the daemon follows, as they are told again and again: where each has been, who sees it, which camera took
// it over, and whether it was lost. Plain functions: what was known and what is told in, what is known out.

import type { Point } from "./orbit";

/** What is told of one of them at an instant. */
export type Sighting = { readonly id: string; readonly position: Point; readonly height: number; readonly cameras: readonly string[] };
export type Step = { readonly at: number; readonly position: Point };
export type HandOver = { readonly at: number; readonly from: string; readonly to: string };
export type Person = Sighting & {
  readonly seenAt: number;
  readonly trail: readonly Step[];
  readonly isLost: boolean;
  /** The camera that shows it best. */
  readonly best: string | null;
  readonly handOvers: readonly HandOver[];
  /** Every camera that has seen it, in that order. */
  readonly everSeenBy: readonly string[];
};
export type People = ReadonlyMap<string, Person>;
/** How well a camera shows a place: more is better, 0 not at all. */
export type Rank = (camera: string, position: Point) => number;

export const TRAIL_MILLIS = 10_000;
/** Who was lost for longer is forgotten, unless somebody follows them. */
export const FORGET_MILLIS = 15_000;
/** Time that goes back, or jumps on by more than this, begins anew. */
const JUMP_MILLIS = 5_000;
/** Another camera must be so much better to take over from one that still sees. */
const BETTER = 1.25;
const MOST_HAND_OVERS = 12;

/** What is known after `told` of the instant `at`. `kept` is followed and never forgotten. */
export function advance(before: People, at: number, told: readonly Sighting[], rank: Rank, kept: string | null = null): Map<string, Person> {
  const next = new Map<string, Person>();
  const last = Math.max(-Infinity, ...[...before.values()].map(({ seenAt }) => seenAt));
  const isAnew = at < last - JUMP_MILLIS || at > last + FORGET_MILLIS;
  for (const [id, person] of before) {
    const isKept = id === kept;
    if (isAnew && !isKept) continue;
    if (at - person.seenAt > FORGET_MILLIS && !isKept) continue;
    next.set(id, { ...person, isLost: true, cameras: [], trail: recent(person.trail, at) });
  }
  for (const sighting of told) next.set(sighting.id, seen(isAnew ? undefined : before.get(sighting.id), at, sighting, rank));
  return next;
}

const recent = (trail: readonly Step[], at: number) => trail.filter((step) => step.at <= at && at - step.at <= TRAIL_MILLIS);

function seen(before: Person | undefined, at: number, sighting: Sighting, rank: Rank): Person {
  const best = bestOf(before?.best ?? null, sighting, rank);
  const handOvers = before?.handOvers ?? [];
  const isOver = before && before.best !== null && best !== null && best !== before.best;
  return {
    ...sighting,
    seenAt: at,
    isLost: false,
    trail: [...recent(before?.trail ?? [], at), { at, position: sighting.position }],
    best,
    handOvers: isOver ? [...handOvers, { at, from: before.best, to: best }].slice(-MOST_HAND_OVERS) : handOvers,
    everSeenBy: [...new Set([...(before?.everSeenBy ?? []), ...sighting.cameras])],
  };
}

/** The camera that shows it best; the one that did so far unless another is clearly better. */
function bestOf(current: string | null, { cameras, position }: Sighting, rank: Rank): string | null {
  const ranked = cameras.map((camera) => ({ camera, rank: rank(camera, position) })).sort((a, b) => b.rank - a.rank);
  const [first] = ranked;
  if (!first) return null;
  const now = ranked.find(({ camera }) => camera === current);
  return now && first.rank < now.rank * BETTER ? now.camera : first.camera;
}

/** The seen one nearest to a place, within `reach` metres along the ground. */
export function nearest(people: Iterable<Person>, position: Point, reach: number): Person | null {
  let found: Person | null = null;
  let least = reach;
  for (const person of people) {
    const away = Math.hypot(person.position[0] - position[0], person.position[1] - position[1]);
    if (!person.isLost && away <= least) [found, least] = [person, away];
  }
  return found;
}
