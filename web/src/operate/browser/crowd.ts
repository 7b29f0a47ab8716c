// Who is drawn from which camera: what several cameras see of one person is one person, shown by the camera that looks most the way
// the viewer does, and stands where the daemon says that they all together saw it stand. Plain functions, with a memory given in.

import type { Point } from "../orbit";
import type { Upright } from "./upright";

/** What one camera sees of somebody. */
export type Seen = { readonly camera: string; readonly track: number; readonly millis: number; readonly eye: Point; readonly upright: Upright };
/** Somebody as the daemon tells of them. */
export type Known = { readonly id: string; readonly position: Point; readonly cameras: readonly string[]; readonly isLost: boolean };
export type Drawn<Of extends Seen> = { readonly seen: Of; readonly place: Point; readonly person: string | null };

/** What is remembered from picture to picture. */
export type Memory = {
  /** Whom a camera's track was taken for. */
  readonly persons: Map<string, string>;
  /** From which camera somebody was drawn. */
  readonly sources: Map<string, string>;
  /** How far from where a track's camera saw them they stand, and of when that is. */
  readonly offsets: Map<string, { by: Point; at: number }>;
  /** Where a track's camera saw them lately. */
  readonly feet: Map<string, { at: number; foot: Point }[]>;
};

export const memory = (): Memory => ({ persons: new Map(), sources: new Map(), offsets: new Map(), feet: new Map() });

/** A foot so near to somebody's place is theirs; who was taken for them before may be farther. */
const NEAR_M = 1.2;
const KEPT_M = 2.5;
/** Two cameras' feet so near are one person's, where the daemon does not say. */
const TOGETHER_M = 0.7;
/** Another camera takes over when it looks so much more the viewer's way (difference of cosines). */
const BETTER = 0.15;
/** What the border cuts off is shown only where nobody sees the whole. */
const CUT = 2;
const FEET = 8;
/** Feet and places are of one time where they differ by no more. */
const SAME_MILLIS = 400;
const MOST_OFFSET_M = 1.5;

const away = (a: Point, b: Point) => Math.hypot(a[0] - b[0], a[1] - b[1]);
const keyOf = ({ camera, track }: Seen) => `${camera} ${track}`;

/** Who is drawn, from where, and standing where. `at` is the time of what the daemon knows. */
export function chosen<Of extends Seen>(all: readonly Of[], known: readonly Known[], at: number, viewer: Point, memory: Memory): Drawn<Of>[] {
  note(all, memory);
  const groups = grouped(all, known, memory);
  const drawn = groups.map(({ person, members }): Drawn<Of> => {
    const seen = best(members, viewer, person === null ? null : (memory.sources.get(person.id) ?? null));
    if (person) memory.sources.set(person.id, seen.camera);
    return { seen, place: person ? placed(seen, person, at, memory) : seen.upright.foot, person: person?.id ?? null };
  });
  forget(all, known, memory);
  return drawn;
}

/** Remembers where feet were. */
function note(all: readonly Seen[], { feet }: Memory): void {
  for (const seen of all) {
    if (seen.track === 0) continue;
    const before = feet.get(keyOf(seen)) ?? [];
    if (before.at(-1)?.at !== seen.millis) feet.set(keyOf(seen), [...before, { at: seen.millis, foot: seen.upright.foot }].slice(-FEET));
  }
}

type Group<Of> = { person: Known | null; members: Of[] };

function grouped<Of extends Seen>(all: readonly Of[], known: readonly Known[], { persons }: Memory): Group<Of>[] {
  const groups: Group<Of>[] = [];
  const of = (person: Known) => groups.find((group) => group.person?.id === person.id);
  const pairs = all.flatMap((seen) => known.filter((person) => !person.isLost && person.cameras.includes(seen.camera)).map((person) => {
    const isKept = seen.track !== 0 && persons.get(keyOf(seen)) === person.id;
    const distance = away(seen.upright.foot, person.position);
    return { seen, person, distance: isKept ? distance / 3 : distance, isNear: distance <= (isKept || seen.upright.isCut ? KEPT_M : NEAR_M) };
  }));
  const taken = new Set<Seen>();
  for (const { seen, person, isNear } of pairs.sort((a, b) => a.distance - b.distance)) {
    if (!isNear || taken.has(seen)) continue;
    const group = of(person);
    // A camera shows somebody once.
    if (group?.members.some(({ camera }) => camera === seen.camera)) continue;
    taken.add(seen);
    if (seen.track !== 0) persons.set(keyOf(seen), person.id);
    if (group) group.members.push(seen);
    else groups.push({ person, members: [seen] });
  }
  for (const seen of all) {
    if (taken.has(seen)) continue;
    const beside = groups.find((group) => group.members.every(({ camera }) => camera !== seen.camera)
      && group.members.some(({ upright }) => away(upright.foot, seen.upright.foot) <= TOGETHER_M));
    if (beside) beside.members.push(seen);
    else groups.push({ person: null, members: [seen] });
  }
  return groups;
}

/** The one whose camera looks most the viewer's way. */
function best<Of extends Seen>(members: readonly Of[], viewer: Point, current: string | null): Of {
  const worth = ({ camera, eye, upright }: Of) => {
    const [a, b] = [eye, viewer].map((from) => {
      const to = [from[0] - upright.foot[0], from[1] - upright.foot[1], from[2] - upright.foot[2]];
      const length = Math.hypot(...to) || 1;
      return to.map((part) => part / length);
    });
    const cosine = (a ?? []).reduce((sum, part, i) => sum + part * (b?.[i] ?? 0), 0);
    return cosine - (upright.isCut ? CUT : 0) + (camera === current ? BETTER : 0);
  };
  return members.reduce((most, one) => (worth(one) > worth(most) ? one : most));
}

/** Where somebody stands: at their camera's foot, moved by as much as it was off when the daemon last told. */
function placed(seen: Seen, person: Known, at: number, { feet, offsets }: Memory): Point {
  const key = keyOf(seen);
  const { foot } = seen.upright;
  const before = offsets.get(key);
  if (seen.track !== 0 && before?.at !== at) {
    const then = (feet.get(key) ?? []).reduce<{ at: number; foot: Point } | null>((nearest, one) =>
      (nearest && Math.abs(nearest.at - at) <= Math.abs(one.at - at) ? nearest : one), null);
    if (then && Math.abs(then.at - at) <= SAME_MILLIS) {
      const target: Point = [person.position[0] - then.foot[0], person.position[1] - then.foot[1], person.position[2] - then.foot[2]];
      if (Math.hypot(target[0], target[1]) <= MOST_OFFSET_M) {
        // Half of the way at a time: places err too.
        const from = before?.by ?? target;
        offsets.set(key, { by: [(from[0] + target[0]) / 2, (from[1] + target[1]) / 2, (from[2] + target[2]) / 2], at });
      }
    }
  }
  const by = offsets.get(key)?.by ?? [0, 0, 0];
  return [foot[0] + by[0], foot[1] + by[1], foot[2] + by[2]];
}

function forget(all: readonly Seen[], known: readonly Known[], { persons, sources, offsets, feet }: Memory): void {
  const tracks = new Set(all.map(keyOf));
  const ids = new Set(known.map(({ id }) => id));
  for (const of of [persons, offsets, feet]) for (const key of of.keys()) if (!tracks.has(key)) of.delete(key);
  for (const id of sources.keys()) if (!ids.has(id)) sources.delete(id);
}
