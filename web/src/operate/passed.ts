// Who was where at a time that is over: of every camera's tracks the places at an instant, and those of several cameras that are
// at one place taken for one.

import type { Point } from "./orbit";
import type { Sighting } from "./people";

export type Track = {
  readonly camera: string;
  readonly track: number;
  readonly began: number;
  readonly ended: number;
  readonly path: readonly { readonly at: number; readonly position: Point | null }[];
};

/** Of two cameras, what is nearer than this is the same. */
const SAME_M = 1.3;
/** Of the past only the share of the picture is told. */
const USUAL_HEIGHT_M = 1.7;

export const keyOf = ({ camera, track }: Track) => `${camera}:${track}`;

/** Where it was at an instant; null before and after, and where nothing is known of it. */
export function positionAt({ began, ended, path }: Track, at: number): Point | null {
  if (at < began || at > ended) return null;
  const next = path.findIndex((point) => point.at >= at);
  const [before, after] = next < 0 ? [path[path.length - 1], undefined] : [path[next - 1], path[next]];
  if (!before?.position || !after?.position) return after?.position ?? before?.position ?? null;
  const share = (at - before.at) / Math.max(after.at - before.at, 1);
  const [from, to] = [before.position, after.position];
  const mixed = (i: 0 | 1 | 2) => from[i] + (to[i] - from[i]) * share;
  return [mixed(0), mixed(1), mixed(2)];
}

/** Everybody who was seen at an instant. Whoever began first names them. */
export function sightingsAt(tracks: readonly Track[], at: number): Sighting[] {
  const groups: { members: Track[]; position: Point }[] = [];
  for (const track of [...tracks].sort((a, b) => a.began - b.began)) {
    const position = positionAt(track, at);
    if (!position) continue;
    const same = groups.find((group) => group.members.every(({ camera }) => camera !== track.camera) && apart(group.position, position) < SAME_M);
    if (same) same.members.push(track);
    else groups.push({ members: [track], position });
  }
  return groups.map(({ members, position }) => ({
    id: members[0] ? keyOf(members[0]) : "",
    position,
    height: USUAL_HEIGHT_M,
    cameras: members.map(({ camera }) => camera),
    members: members.map(keyOf),
  }));
}

const apart = (a: Point, b: Point) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Names whoever is followed as before where one of their tracks is still there: `known` are the tracks that were theirs. */
export function renamed(sightings: readonly Sighting[], id: string | null, known: ReadonlySet<string>): Sighting[] {
  if (id === null) return [...sightings];
  const isTheirs = (sighting: Sighting) => sighting.id === id || (sighting.members ?? []).some((member) => known.has(member));
  let isFound = false;
  return sightings.map((sighting) => {
    if (isFound || !isTheirs(sighting)) return sighting;
    isFound = true;
    return { ...sighting, id };
  });
}
