// The wall that is being edited and not kept yet: every change is a step that can be undone, the draft outlives leaving and
// reloading in this browser, and nothing reaches the daemon until it is asked for.

import { computed, effect, signal } from "@preact/signals";
import { Trouble, change as send, ask, told } from "../ask";
import { nameEnding, session } from "../session";
import { say } from "../strings";
import { type Wall, type WallDocument, printWall, readWall } from "./document";
import { type Faults, faultOfId, placed, tried } from "./validity";

/** `tag` is the daemon's version that it came from; null of a new wall. */
type Draft = { readonly id: string; readonly wall: Wall };
type Base = { readonly id: string | null; readonly tag: string | null; readonly wall: Wall | null };
type History = { readonly past: readonly Draft[]; readonly now: Draft; readonly future: readonly Draft[] };

const MOST_STEPS = 200;
const MERGE_MILLIS = 1_000;
const KEEP_MILLIS = 300;
const JUDGE_MILLIS = 150;
/** Where the daemon could not be asked. */
const JUDGE_AGAIN_MILLIS = 2_000;
const KEPT = "videofields.wall";
/** How a new wall is kept until it has a name. */
const NEW = "";

const history = signal<History | null>(null);
export const base = signal<Base>({ id: null, tag: null, wall: null });
export const draft = computed(() => history.value?.now ?? null);
export const canUndo = computed(() => (history.value?.past.length ?? 0) > 0);
export const canRedo = computed(() => (history.value?.future.length ?? 0) > 0);
export const mayChange = computed(() => ["operator", "admin"].includes(session.value?.role ?? ""));
/** Ids that a new wall cannot have. */
export const takenIds = signal<readonly string[]>([]);

/** Whether the draft differs from what the daemon has. */
export const isDirty = computed(() => {
  const [now, of] = [draft.value, base.value];
  return now !== null && JSON.stringify(now.wall) !== JSON.stringify(of.wall);
});

/** What the daemon found wrong with the draft as it was when it heard of it last. */
const judged = signal<{ of: Wall; faults: Faults } | null>(null);

export const faults = computed<Faults>(() => {
  const now = draft.value;
  if (!now) return new Map();
  return new Map([...(judged.value?.faults ?? []), ...(base.value.id === null ? faultOfId(now.id, takenIds.value, nameEnding()) : faultOfId(now.id, [], ""))]);
});

/** Whether the daemon has found nothing wrong with what the draft shows. */
export const isSound = computed(() => {
  const now = draft.value;
  // What cannot be changed here is as it was kept.
  if (!mayChange.value) return now !== null;
  return judged.value?.of === now?.wall && ![...faults.value.keys()].some((pointer) => /^\/(surface|view|viewer_m|zoom|parameters|scene)/.test(pointer));
});

let merging: { key: string; at: number } | null = null;

/** Changes the draft; changes under one key shortly after one another are one step. */
export function edit(how: (wall: Wall) => Wall, key?: string): void {
  editDraft((of) => ({ ...of, wall: how(of.wall) }), key);
}

export function rename(id: string): void {
  editDraft((of) => ({ ...of, id }), "id");
}

function editDraft(how: (of: Draft) => Draft, key?: string): void {
  const before = history.value;
  if (!before || !mayChange.value) return;
  const now = performance.now();
  const isMerged = key !== undefined && merging?.key === key && now - merging.at < MERGE_MILLIS;
  merging = key === undefined ? null : { key, at: now };
  const past = isMerged ? before.past : [...before.past, before.now].slice(-MOST_STEPS);
  history.value = { past, now: how(before.now), future: [] };
}

/** The next change is a step of its own. */
export function settle(): void {
  merging = null;
}

export function undo(): void {
  const of = history.value;
  const last = of?.past.at(-1);
  if (of && last) history.value = { past: of.past.slice(0, -1), now: last, future: [of.now, ...of.future] };
  merging = null;
}

export function redo(): void {
  const of = history.value;
  const [next, ...rest] = of?.future ?? [];
  if (of && next) history.value = { past: [...of.past, of.now], now: next, future: rest };
  merging = null;
}

type Kept = { readonly base: Base; readonly draft: Draft };

function kept(id: string | null): Kept | null {
  try {
    const read = JSON.parse(localStorage.getItem(`${KEPT}.${id ?? NEW}`) ?? "null") as Partial<Kept> | null;
    // What another version of the pages kept may be anything.
    return read?.base && read.draft && "surface" in read.draft.wall ? { base: read.base, draft: read.draft } : null;
  } catch {
    return null;
  }
}

function forget(id: string | null): void {
  try {
    localStorage.removeItem(`${KEPT}.${id ?? NEW}`);
  } catch {
    // Then there was nothing kept.
  }
}

function begin(of: Base, from: Draft): void {
  [merging, judged.value] = [null, null];
  base.value = of;
  history.value = { past: [], now: from, future: [] };
}

/** Takes up a new wall: the one that was left, or `fresh`. */
export function openNew(fresh: Wall): void {
  const left = kept(null);
  begin({ id: null, tag: null, wall: null }, left?.draft ?? { id: "", wall: fresh });
}

const pathOf = (id: string) => `/api/v1/walls/${encodeURIComponent(id)}`;

async function fetched(id: string): Promise<{ tag: string | null; wall: Wall }> {
  const response = await ask(pathOf(id));
  return { tag: plain(response.headers.get("ETag")), wall: readWall((await response.json()) as WallDocument) };
}

/** A tag as conditions take it, without the mark of a compressed answer. */
const plain = (tag: string | null) => tag?.replace(/-gzip"$/, '"') ?? null;

/** Takes up a wall: what was left of it in this browser, else as the daemon has it. */
export async function open(id: string): Promise<void> {
  if (base.value.id === id && history.value) return;
  close();
  const { tag, wall } = await fetched(id);
  const left = kept(id);
  begin(left ? left.base : { id, tag, wall }, left?.draft ?? { id, wall });
}

export function close(): void {
  keep();
  history.value = null;
  base.value = { id: null, tag: null, wall: null };
}

/** Forgets what was changed, and takes the wall as the daemon has it. */
export async function discard(): Promise<void> {
  const { id } = base.value;
  forget(id);
  if (id === null) {
    close();
    forget(null);
    return;
  }
  history.value = null;
  await open(id);
}

/** Keeps the draft. Throws `Trouble`; faults with a place are told there. With `isForced` over what somebody else kept meanwhile. */
export async function save(isForced = false): Promise<string> {
  const now = draft.value;
  if (!now) throw new Trouble(say("wall.none.open"), 0);
  const of = base.value;
  const tag = isForced && of.id !== null ? (await fetched(of.id)).tag : of.tag;
  try {
    const response = await send<Response>("PUT", pathOf(now.id), printWall(now.wall), { tag, raw: true });
    const wall = readWall((await response.json()) as WallDocument);
    forget(of.id);
    base.value = { id: now.id, tag: plain(response.headers.get("ETag")), wall };
    if (history.value) history.value = { ...history.value, now: { id: now.id, wall } };
    return now.id;
  } catch (error) {
    if (error instanceof Trouble && error.faults.length > 0) {
      judged.value = { of: now.wall, faults: placed(error) };
    }
    throw error;
  }
}

export async function remove(): Promise<void> {
  const { id, tag } = base.value;
  if (id === null) return;
  await send("DELETE", pathOf(id), undefined, tag === null ? {} : { tag });
  forget(id);
  history.value = null;
  base.value = { id: null, tag: null, wall: null };
}

/** Brings a version of before back as the newest one. */
export async function restore(number: number): Promise<void> {
  const { id, tag } = base.value;
  if (id === null) return;
  await send("POST", `${pathOf(id)}/versions/${number}/restore`, undefined, tag === null ? {} : { tag });
  await discard();
}

/** Why something came to nothing; what somebody else changed meanwhile in words of its own. */
export function reason(error: unknown): string {
  return error instanceof Trouble && error.status === 412 ? say("wall.changed") : told(error);
}

let keeping: ReturnType<typeof setTimeout> | undefined;

function keep(): void {
  clearTimeout(keeping);
  const [now, of] = [draft.value, base.value];
  if (!now || !mayChange.value) return;
  if (!isDirty.value) {
    forget(of.id);
    return;
  }
  try {
    localStorage.setItem(`${KEPT}.${of.id ?? NEW}`, JSON.stringify({ base: of, draft: now } satisfies Kept));
  } catch {
    // The draft lasts as long as the page then.
  }
}

effect(() => {
  if (!draft.value) return;
  clearTimeout(keeping);
  keeping = setTimeout(keep, KEEP_MILLIS);
});

const changing = computed(() => (mayChange.value ? (draft.value?.wall ?? null) : null));

// The daemon is asked what is wrong as soon as typing rests; what it says of a draft that has changed since is not heard.
effect(() => {
  const wall = changing.value;
  if (wall === null || judged.peek()?.of === wall) return undefined;
  const gone = new AbortController();
  let timer: ReturnType<typeof setTimeout>;
  const judge = async () => {
    const found = await tried(base.peek().id, wall, gone.signal).catch(() => null);
    if (gone.signal.aborted) return;
    if (found === null) timer = setTimeout(() => void judge(), JUDGE_AGAIN_MILLIS);
    else judged.value = { of: wall, faults: found };
  };
  timer = setTimeout(() => void judge(), JUDGE_MILLIS);
  return () => {
    clearTimeout(timer);
    gone.abort();
  };
});
// Typing and reloading at once must lose nothing.
if (typeof addEventListener !== "undefined") addEventListener("pagehide", keep);
