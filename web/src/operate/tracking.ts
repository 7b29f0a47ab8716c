// People and things that are shown: of now as the daemon's stream tells them, of the past as it keeps who was where, with the same ids.

import { computed, effect, signal } from "@preact/signals";
import { api, content, told } from "../ask";
import { type Path, sightingsAt } from "./passed";
import { instant, millisOf } from "./moments";
import { type People, type Person, type Sighting, TRAIL_MILLIS, advance, nearest } from "./people";
import { allowed } from "./rights";
import { pixelsPerMetre } from "./scenery";
import * as state from "./state";
import type { Point } from "./orbit";

/** How often the present is told, a second. */
const RATE = 5;
const AGAIN_MILLIS = 3_000;
/** Who was where is asked for by the minute, a little more on both sides. */
const PIECE_MILLIS = 60_000;
const BESIDE_MILLIS = TRAIL_MILLIS + 2_000;
/** The minute at hand is asked for again, since it goes on. */
const STALE_MILLIS = 4_000;
const MOST_PATHS = 1_000;
const MOST_PAGES = 5;
/** How a trail of the past is sampled. */
const TRAIL_STEP_MILLIS = 500;
/** Who is lost may be who appears near there soon after. */
const SUCCESSOR_M = 4;

/** Everybody who is shown or was lost just now, by id. */
export const people = signal<People>(new Map());
/** The instant that they are of. */
export const peopleAt = signal(NaN);
/** Why nobody is told; null while all is well. */
export const peopleTrouble = signal<string | null>(null);

/** Whom the view follows; null of nobody, and of somebody who was never told. */
export const followedPerson = computed((): Person | null => {
  const id = state.followed.value;
  return id === undefined ? null : (people.value.get(id) ?? null);
});

/** Who may be the one that was lost: somebody who appeared near there. */
export const successor = computed((): Person | null => {
  const lost = followedPerson.value;
  if (!lost?.isLost) return null;
  const others = [...people.value.values()].filter(({ id, trail }) => id !== lost.id && (trail[0]?.at ?? 0) >= lost.seenAt - 1_000);
  return nearest(others, lost.position, SUCCESSOR_M);
});

function take(at: number, told: readonly Sighting[]): void {
  people.value = advance(people.peek(), at, told, pixelsPerMetre, state.followed.peek() ?? null);
  peopleAt.value = at;
}

type Told = { time: string; tracks: { id: number; position_m: number[]; height_m: number; cameras: string[] }[] };

/** Listens to the present until the answered function is called. */
function listen(scene: string): () => void {
  let source: EventSource | null = null;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const begin = () => {
    source = new EventSource(`/api/v1/scenes/${encodeURIComponent(scene)}/tracks/stream?rate=${RATE}`);
    source.addEventListener("tracks", (event: MessageEvent<string>) => {
      const { time, tracks } = JSON.parse(event.data) as Told;
      peopleTrouble.value = null;
      take(millisOf(time), tracks.map(({ id, position_m, height_m, cameras }) => ({ id: String(id), position: pointOf(position_m), height: height_m, cameras })));
    });
    source.addEventListener("error", () => {
      // It connects again by itself unless it was refused.
      if (source?.readyState === EventSource.CLOSED) timer = setTimeout(begin, AGAIN_MILLIS);
    });
  };
  begin();
  return () => {
    clearTimeout(timer);
    source?.close();
  };
}

const pointOf = ([x = 0, y = 0, z = 0]: readonly number[]): Point => [x, y, z];

type Piece = { scene: string; from: number; paths: Path[]; askedAt: number };
let piece: Piece | null = null;
let asking: Promise<void> | null = null;

async function learnPiece(scene: string, from: number): Promise<void> {
  const query = { from: instant(Math.max(from - BESIDE_MILLIS, 0)), to: instant(from + PIECE_MILLIS + BESIDE_MILLIS), limit: MOST_PATHS };
  const paths: Path[] = [];
  let cursor: string | undefined;
  for (let page = 0; page < MOST_PAGES; page++) {
    const answer = await content(api.GET("/api/v1/scenes/{id}/entities/paths", {
      params: { path: { id: scene }, query: cursor === undefined ? query : { ...query, cursor } },
    }));
    paths.push(...answer.entities.map(({ id, height_m, path }) => ({
      id: String(id),
      height: height_m,
      steps: path.map(({ at, point_m, cameras }) => ({ at: millisOf(at), position: pointOf(point_m), cameras })),
    })));
    if (answer.next === null) break;
    cursor = answer.next;
  }
  piece = { scene, from, paths, askedAt: performance.now() };
}

/** Everybody at an instant of the past. */
async function recall(scene: string, at: number): Promise<void> {
  const from = Math.floor(at / PIECE_MILLIS) * PIECE_MILLIS;
  const isThere = piece?.scene === scene && piece.from === from;
  const isGrowing = Date.now() - at < PIECE_MILLIS * 3 && performance.now() - (piece?.askedAt ?? 0) > STALE_MILLIS;
  if (!isThere || isGrowing) {
    asking ??= learnPiece(scene, from).finally(() => (asking = null));
    try {
      await asking;
      peopleTrouble.value = null;
    } catch (error) {
      peopleTrouble.value = told(error);
      return;
    }
  }
  if (piece?.scene !== scene || state.at.peek() === null || state.shown.peek()?.millis !== at) return;
  show(piece.paths, at);
}

function show(paths: readonly Path[], at: number): void {
  const followed = state.followed.peek() ?? null;
  // The trail is looked up as well, so that whoever comes here by the timeline sees where people came from.
  const isAnew = !(Math.abs(at - peopleAt.peek()) < TRAIL_STEP_MILLIS * 4);
  if (isAnew) people.value = new Map([...people.peek()].filter(([id]) => id === followed));
  const first = isAnew ? at - TRAIL_MILLIS : at;
  for (let moment = first; moment <= at; moment += TRAIL_STEP_MILLIS) take(moment, sightingsAt(paths, moment));
}

/** Keeps `people` up to date until the answered function is called. */
export function track(): () => void {
  let isPast = false;
  const stop = effect(() => {
    const scene = state.scene.value?.id;
    const isNow = state.at.value === null;
    if (scene === undefined || allowed(isNow ? "live" : "history").length === 0) return undefined;
    if (isPast === isNow) people.value = new Map();
    isPast = !isNow;
    return isNow ? listen(scene) : effect(() => {
      const at = state.shown.value?.millis;
      if (at !== undefined) void recall(scene, at);
    });
  });
  return () => {
    stop();
    people.value = new Map();
  };
}
