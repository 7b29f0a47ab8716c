// One screen of a wall: shows a tile, frame by frame as they come, and says when it is behind.
//
// /wall?wall=ID&tile=T, and if wanted pattern=test|identify, blend=off and delay=MILLISECONDS: every screen shows a frame that long
// after it was due, so that screens on networks of unlike speed change at once; a frame's time, at most a quarter of a second,
// where nothing is said. Screens of one browser wait for each other beside that. A screen that nobody stands before is let in by
// a token in the fragment, #token=vf_...: a browser sends that nowhere by itself. Where neither address nor key names a pattern, a
// screen shows what the place Wall has all of them show. The key h, or a touch, shows in a corner how the screen fares; the daemon
// is told that too.

import "./wall.css";
import { Trouble, ask, send, told } from "../ask";
import { pauser } from "../pause";
import { say } from "../strings";
import { type Message, openChannel } from "./channel";
import { choose } from "./choice";
import { type Frame, read } from "./frames";
import * as health from "./health";
import { makeLock } from "./lock";

const LEAST_PAUSE_MILLIS = 500;
const MOST_PAUSE_MILLIS = 15_000;

/** Without a picture for so long, or behind by so much, the screen says so. */
const STALE_MILLIS = 2_000;
const BEHIND_MILLIS = 5_000;

/** WebSockets that came to nothing before pictures are pulled, and for how long they are until it is tried again. */
const TRIES = 2;
const PULL_MILLIS = 30_000;

/** How often the daemon is told how the screen fares. */
const TELL_MILLIS = 2_000;

/** How long a frame is held for other screens of this browser that do not have it yet. */
const PATIENCE_MILLIS = 2_000;

type Shown = Omit<Frame, "blob"> & { shown: number; behind: number };

function element<Kind extends HTMLElement>(id: string, kind: new () => Kind): Kind {
  const found = document.getElementById(id);
  if (found instanceof kind) return found;
  throw new Error(`the page has no ${id}`);
}

const query = new URLSearchParams(location.search);
const [wall, tile] = [query.get("wall") ?? "", query.get("tile") ?? ""];
const asked = query.get("delay");
const screen = element("screen", HTMLCanvasElement);
const state = element("state", HTMLParagraphElement);
const corner = element("health", HTMLElement);
const context = screen.getContext("2d", { alpha: false });
const { pause, wake } = pauser();
/** What lets this screen in; taken out of the address, so that no picture of the screen and no history shows it. */
const token = new URLSearchParams(location.hash.slice(1)).get("token");
if (token !== null) history.replaceState(null, "", location.pathname + location.search);

/** What keys have this screen show; null is what the daemon has all of the wall's screens show. */
const PATTERNS: Record<string, health.Pattern | null> = { i: "identify", t: "test", 0: null };
let pattern = Object.values(PATTERNS).find((known) => known === query.get("pattern")) ?? null;
let counts = health.NOTHING;
let way: health.Health["way"] = "none";
const page = crypto.getRandomValues(new Uint32Array(2)).join("-");
const lock = makeLock();
let newest: Shown | null = null;
let trouble: string = say("screen.connecting");
let ended = () => {};
/** Least difference that was seen between this machine's clock and the daemon's, milliseconds. */
let offset = Infinity;

/** What the daemon is asked for beside which tile. */
function wishes(): Record<string, string> {
  const blend = query.get("blend");
  return { ...(pattern ? { pattern } : {}), ...(blend ? { blend } : {}) };
}

function path(what: string): string {
  return `/api/v1/walls/${encodeURIComponent(wall)}/tiles/${encodeURIComponent(tile)}/${what}`;
}

/** Shows a picture at its time; one that was overtaken meanwhile is left out. */
async function show({ blob, ...frame }: Frame): Promise<void> {
  const bitmap = await createImageBitmap(blob);
  offset = Math.min(offset, Date.now() - frame.sentMillis);
  const delay = health.delayOf(asked, frame.rate);
  const due = frame.rate > 0 ? (frame.number / frame.rate) * 1e3 + offset + delay : Date.now();
  channel.tell({ kind: "holds", wall, page, version: frame.version, frame: frame.number });
  const wait = Math.min(due - Date.now(), 2 * delay);
  if (wait > 0) await new Promise((resolve) => setTimeout(resolve, wait));
  await lock.together(frame.version, frame.number, PATIENCE_MILLIS);
  if (newest && newest.version === frame.version && newest.number >= frame.number) {
    bitmap.close();
    return;
  }
  newest = { ...frame, shown: performance.now(), behind: frame.sentMillis - frame.millis };
  trouble = "";
  requestAnimationFrame(() => {
    if (screen.width !== bitmap.width || screen.height !== bitmap.height) {
      [screen.width, screen.height] = [bitmap.width, bitmap.height];
    }
    context?.drawImage(bitmap, 0, 0);
    bitmap.close();
    screen.dataset["frame"] = String(frame.number);
    screen.dataset["pattern"] = String(frame.isPattern);
    counts = health.counted(counts, { number: frame.number, version: frame.version, rate: frame.rate, at: performance.now() }, Date.now() - due);
    announce();
  });
}

function unreadable(): void {
  trouble = say("screen.unreadable");
  counts = { ...counts, unreadable: counts.unreadable + 1 };
}

/** Pictures by WebSocket until it ends; how many there were, and why it ended. */
function bySocket(): Promise<{ n: number; reason: string }> {
  return new Promise((resolve) => {
    const origin = location.origin.replace(/^http/, "ws");
    const socket = new WebSocket(`${origin}${path("frames")}?${new URLSearchParams(wishes()).toString()}`);
    let n = 0;
    const talk = (what: object) => {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(what));
    };
    socket.binaryType = "arraybuffer";
    ended = () => socket.close();
    const take = async (data: string | ArrayBuffer) => {
      if (typeof data === "string") {
        trouble = (JSON.parse(data) as { waiting?: string }).waiting ?? trouble;
        return;
      }
      const frame = read(data);
      if (!frame) return;
      n += 1;
      way = "socket";
      await show(frame).catch(unreadable);
      talk({ ack: frame.number });
    };
    socket.addEventListener("message", ({ data }: MessageEvent<string | ArrayBuffer>) => void take(data));
    const telling = setInterval(() => talk({ health: health.told(own()) }), TELL_MILLIS);
    socket.addEventListener("close", ({ reason }) => {
      clearInterval(telling);
      resolve({ n, reason });
    });
  });
}

/** Pictures one by one, for where WebSockets do not come through. */
async function byPulling(): Promise<void> {
  const until = performance.now() + PULL_MILLIS;
  const wanted = new AbortController();
  let at: number | null = null;
  ended = () => wanted.abort();
  while (!wanted.signal.aborted && performance.now() < until) {
    const begun = Date.now();
    const response = await ask(path("frame.jpg"), { ...wishes(), at });
    const field = (name: string) => response.headers.get(name) ?? "";
    const number = Number(field("videofields-wall-frame"));
    const millis = Date.parse(field("videofields-time"));
    const version = field("videofields-wall-version");
    const blob = await response.blob();
    way = "pull";
    await show({ number, version, millis, sentMillis: begun, rate: 0, isLive: false, isRestricted: false, isPattern: false, blob });
    at = number + 1;
  }
}

/** Lets this screen in by the token that its address had; the daemon keeps it in a cookie that no script reads. */
async function enter(): Promise<void> {
  if (token === null) return;
  const response = await send("/api/v1/session", { method: "POST", body: JSON.stringify({ token }) });
  if (response.ok) return;
  const { detail } = (await response.json().catch(() => ({}))) as { detail?: string };
  throw new Trouble(say("screen.refused", { detail: detail ?? response.status }), 0);
}

async function run(): Promise<never> {
  let failures = 0;
  const tryToEnter = () => enter().catch((refusal: unknown) => (trouble = told(refusal)));
  await tryToEnter();
  for (;;) {
    try {
      const { n, reason } = await bySocket();
      failures = n > 0 ? 0 : failures + 1;
      trouble = reason || say("screen.gone");
      way = "none";
      // Why it came to nothing, which a browser does not tell: who asks is a stranger, or there is no such tile.
      if (n === 0) await ask(path("frame.jpg"), { pattern: "test" });
      if (failures >= TRIES) await byPulling();
    } catch (error) {
      failures += 1;
      trouble = told(error);
      if (error instanceof Trouble && error.status === 401) {
        trouble = say("screen.login");
        await tryToEnter();
      }
    }
    counts = { ...counts, reconnects: counts.reconnects + 1 };
    // Many screens that lost one daemon do not all come back at once.
    const most = Math.min(LEAST_PAUSE_MILLIS * 2 ** failures, MOST_PAUSE_MILLIS);
    await pause(most * (0.5 + Math.random() / 2));
  }
}

/** Says how old the picture is, where it is older than it should be. */
function tell(): void {
  const age = newest ? performance.now() - newest.shown : Infinity;
  const late = newest?.isLive && newest.behind > BEHIND_MILLIS ? newest.behind : 0;
  const usual = newest?.rate ? 3e3 / newest.rate : 0;
  const isStale = age > Math.max(STALE_MILLIS, usual);
  const seconds = Math.round((isStale && newest ? age + late : late) / 1e3);
  const old = seconds > 0 ? say("screen.old", { seconds }) : "";
  state.textContent = [old, isStale ? trouble : ""].filter(Boolean).join(" ");
  state.hidden = state.textContent === "";
}

async function keepAwake(): Promise<void> {
  if (document.hidden || !("wakeLock" in navigator)) return;
  // Refused on battery, or where the page is not encrypted: the screen's own settings decide then.
  await navigator.wakeLock.request("screen").catch(() => null);
}

/** How this screen fares. */
function own(): health.Health {
  const now = performance.now();
  return {
    wall, tile, way,
    frame: newest?.number ?? null, ageMillis: newest ? now - newest.shown : null,
    rate: health.rateOf(counts, now), wantedRate: newest?.rate ?? 0,
    missed: counts.missed, late: counts.late, unreadable: counts.unreadable,
    // What the first attempts took is no connection that was lost.
    reconnects: counts.newest ? counts.reconnects : 0,
    offsetMillis: Number.isFinite(offset) ? offset : null,
  };
}

/** Tells the pages of this browser. */
function announce(): void {
  channel.tell({ kind: "shows", wall, page, frame: newest?.number ?? null });
}

function hear(message: Message): void {
  if (message.kind === "shows" && message.wall === wall && message.page !== page) lock.shows(message.page, message.frame);
  else if (message.kind === "holds" && message.wall === wall) lock.holds(message.page, message.version, message.frame);
  else if (message.kind === "gone") lock.gone(message.page);
}

/** Has the screen show something else, at once. */
function setPattern(chosen: health.Pattern | null): void {
  if (chosen === pattern) return;
  pattern = chosen;
  newest = null;
  ended();
  wake();
}

/** Shows in the corner how the screen fares, while that is wanted. */
function tellHealth(): void {
  announce();
  if (corner.hidden) return;
  health.draw(corner, health.rows(own(), newest?.behind ?? null, health.together(newest?.number ?? null, lock.peers())));
}

function toggleHealth(): void {
  corner.hidden = !corner.hidden;
  tellHealth();
}

const channel = openChannel(wall && tile ? hear : () => {});

if (wall && tile) {
  document.title = say("screen.title", { tile, wall });
  document.addEventListener("visibilitychange", () => void keepAwake());
  document.addEventListener("click", (event) => {
    // A finger has no key h; two touches fill the screen.
    if (event.pointerType === "touch") toggleHealth();
    else void document.documentElement.requestFullscreen().catch(() => null);
  });
  document.addEventListener("dblclick", () => void document.documentElement.requestFullscreen().catch(() => null));
  document.addEventListener("keydown", ({ key }) => {
    if (key === "h") toggleHealth();
    const chosen = PATTERNS[key];
    if (chosen !== undefined) setPattern(chosen);
  });
  addEventListener("pagehide", () => channel.tell({ kind: "gone", page }));
  setInterval(tell, 250);
  setInterval(tellHealth, 500);
  void keepAwake();
  void run();
} else {
  void choose(element("choice", HTMLElement), enter);
}
