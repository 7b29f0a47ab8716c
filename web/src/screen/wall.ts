// One screen of a wall: shows a tile, frame by frame as they come, and says when it is behind.
//
// /wall?wall=ID&tile=T, and if wanted pattern=test|identify, blend=off and delay=MILLISECONDS: with it every screen shows a
// frame that long after it was due, so that screens on networks of unlike speed change at once. A screen that nobody stands
// before is let in by a token in the fragment, #token=vf_...: a browser sends that nowhere by itself.

import "./wall.css";
import { Trouble, api, ask, content, send, told } from "../ask";
import { pauser } from "../pause";
import { say } from "../strings";
import { type Frame, read } from "./frames";

const LEAST_PAUSE_MILLIS = 500;
const MOST_PAUSE_MILLIS = 15_000;

/** Without a picture for so long, or behind by so much, the screen says so. */
const STALE_MILLIS = 2_000;
const BEHIND_MILLIS = 5_000;

/** WebSockets that came to nothing before pictures are pulled, and for how long they are until it is tried again. */
const TRIES = 2;
const PULL_MILLIS = 30_000;

type Shown = Omit<Frame, "blob"> & { shown: number; behind: number };

function element<Kind extends HTMLElement>(id: string, kind: new () => Kind): Kind {
  const found = document.getElementById(id);
  if (found instanceof kind) return found;
  throw new Error(`the page has no ${id}`);
}

const query = new URLSearchParams(location.search);
const [wall, tile] = [query.get("wall") ?? "", query.get("tile") ?? ""];
const delay = Math.min(Math.max(Number(query.get("delay")) || 0, 0), 2_000);
const screen = element("screen", HTMLCanvasElement);
const state = element("state", HTMLParagraphElement);
const context = screen.getContext("2d", { alpha: false });
const { pause, wake } = pauser();
/** What lets this screen in; taken out of the address, so that no picture of the screen and no history shows it. */
const token = new URLSearchParams(location.hash.slice(1)).get("token");
if (token !== null) history.replaceState(null, "", location.pathname + location.search);

let pattern = query.get("pattern") ?? "none";
let newest: Shown | null = null;
let trouble: string = say("screen.connecting");
let ended = () => {};
/** Least difference that was seen between this machine's clock and the daemon's, milliseconds. */
let offset = Infinity;

/** What the daemon is asked for beside which tile. */
function wishes(): Record<string, string> {
  const blend = query.get("blend");
  return blend ? { pattern, blend } : { pattern };
}

function path(what: string): string {
  return `/api/v1/walls/${encodeURIComponent(wall)}/tiles/${encodeURIComponent(tile)}/${what}`;
}

/** Shows a picture at its time; one that was overtaken meanwhile is left out. */
async function show({ blob, ...frame }: Frame): Promise<void> {
  const bitmap = await createImageBitmap(blob);
  offset = Math.min(offset, Date.now() - frame.sentMillis);
  if (delay > 0 && frame.rate > 0) {
    const due = (frame.number / frame.rate) * 1e3 + offset + delay;
    const wait = Math.min(due - Date.now(), 2 * delay);
    if (wait > 0) await new Promise((resolve) => setTimeout(resolve, wait));
  }
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
  });
}

/** Pictures by WebSocket until it ends; how many there were, and why it ended. */
function bySocket(): Promise<{ n: number; reason: string }> {
  return new Promise((resolve) => {
    const origin = location.origin.replace(/^http/, "ws");
    const socket = new WebSocket(`${origin}${path("frames")}?${new URLSearchParams(wishes()).toString()}`);
    let n = 0;
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
      await show(frame).catch(() => (trouble = say("screen.unreadable")));
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ ack: frame.number }));
    };
    socket.addEventListener("message", ({ data }: MessageEvent<string | ArrayBuffer>) => void take(data));
    socket.addEventListener("close", ({ reason }) => resolve({ n, reason }));
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
    await show({ number, version, millis, sentMillis: begun, rate: 0, isLive: false, isRestricted: false, blob });
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

/** Lists every wall's tiles, for whoever stands before a screen to choose. */
async function choose(): Promise<void> {
  element("choice", HTMLElement).hidden = false;
  element("choice-title", HTMLElement).textContent = say("screen.which");
  const help = element("choice-help", HTMLParagraphElement);
  try {
    await enter();
    const { walls } = await content(api.GET("/api/v1/walls"));
    help.textContent = walls.length > 0 ? say("screen.choose") : say("screen.noWall");
    for (const { id, name } of walls) {
      const { tiles } = await content(api.GET("/api/v1/walls/{id}/tiles", { params: { path: { id } } }));
      const [title, list] = [document.createElement("h2"), document.createElement("div")];
      title.textContent = name || id;
      list.className = "tiles";
      list.append(...tiles.map((one) => link(id, one.id)));
      element("walls", HTMLDivElement).append(title, list);
    }
  } catch (error) {
    const isStranger = error instanceof Trouble && error.status === 401;
    help.textContent = isStranger ? say("screen.loginFirst") : told(error);
  }
}

function link(wall: string, tile: string): HTMLAnchorElement {
  const anchor = document.createElement("a");
  anchor.href = `/wall?${new URLSearchParams({ wall, tile }).toString()}`;
  anchor.textContent = tile;
  return anchor;
}

const PATTERNS: Record<string, string> = { i: "identify", t: "test", 0: "none" };

if (wall && tile) {
  document.title = say("screen.title", { tile, wall });
  document.addEventListener("visibilitychange", () => void keepAwake());
  document.addEventListener("click", () => void document.documentElement.requestFullscreen().catch(() => null));
  document.addEventListener("keydown", ({ key }) => {
    const chosen = PATTERNS[key];
    if (!chosen || chosen === pattern) return;
    pattern = chosen;
    newest = null;
    ended();
    wake();
  });
  setInterval(tell, 250);
  void keepAwake();
  void run();
} else {
  void choose();
}
