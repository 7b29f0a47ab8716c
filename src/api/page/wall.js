// One screen of a wall: shows a tile, frame by frame as they come, and says when it is behind.
//
// /wall?wall=ID&tile=T, and if wanted pattern=test|identify, blend=off and delay=MILLISECONDS: with it every screen shows a
// frame that long after it was due, so that screens on networks of unlike speed change at once. A screen that nobody stands
// before is let in by a token in the fragment, #token=vf_...: a browser sends that nowhere by itself.

import { Trouble, ask, pauser } from "/ask.js";
import { frames } from "/frames.js";

const LEAST_PAUSE_MILLIS = 500;
const MOST_PAUSE_MILLIS = 15_000;

/** Without a picture for so long, or behind by so much, the screen says so. */
const STALE_MILLIS = 2_000;
const BEHIND_MILLIS = 5_000;

/** WebSockets that came to nothing before pictures are pulled, and for how long they are until it is tried again. */
const TRIES = 2;
const PULL_MILLIS = 30_000;

const query = new URLSearchParams(location.search);
const [wall, tile] = [query.get("wall"), query.get("tile")];
const delay = Math.min(Math.max(Number(query.get("delay")) || 0, 0), 2_000);
const [screen, state] = ["screen", "state"].map((id) => document.getElementById(id));
const context = screen.getContext("2d", { alpha: false });
const { pause, wake } = pauser();
/** What lets this screen in; taken out of the address, so that no picture of the screen and no history shows it. */
const token = new URLSearchParams(location.hash.slice(1)).get("token");
if (token) history.replaceState(null, "", location.pathname + location.search);

let pattern = query.get("pattern") ?? "none";
let newest = null;
let trouble = "Connecting ...";
let ended = () => {};
/** Least difference that was seen between this machine's clock and the daemon's, milliseconds. */
let offset = Infinity;

/** What the daemon is asked for beside which tile. */
function wishes() {
  const given = { pattern };
  if (query.get("blend")) given.blend = query.get("blend");
  return new URLSearchParams(given).toString();
}

function path(what) {
  return `/api/v1/walls/${encodeURIComponent(wall)}/tiles/${encodeURIComponent(tile)}/${what}`;
}

/** Shows a picture at its time; one that was overtaken meanwhile is left out. */
async function show(frame) {
  const bitmap = await createImageBitmap(frame.blob);
  offset = Math.min(offset, Date.now() - frame.sentMillis);
  if (delay > 0 && frame.rate > 0) {
    const due = (frame.number / frame.rate) * 1e3 + offset + delay;
    const wait = Math.min(due - Date.now(), 2 * delay);
    if (wait > 0) await new Promise((resolve) => setTimeout(resolve, wait));
  }
  if (newest && newest.version === frame.version && newest.number >= frame.number) return bitmap.close();
  newest = { ...frame, blob: null, shown: performance.now(), behind: frame.sentMillis - frame.millis };
  trouble = "";
  requestAnimationFrame(() => {
    if (screen.width !== bitmap.width || screen.height !== bitmap.height) {
      [screen.width, screen.height] = [bitmap.width, bitmap.height];
    }
    context.drawImage(bitmap, 0, 0);
    bitmap.close();
    screen.dataset.frame = String(frame.number);
  });
}

/** Pictures by WebSocket until it ends; how many there were, and why it ended. */
function bySocket() {
  return new Promise((resolve) => {
    const origin = location.origin.replace(/^http/, "ws");
    const socket = new WebSocket(`${origin}${path("frames")}?${wishes()}`);
    let n = 0;
    socket.binaryType = "arraybuffer";
    ended = () => socket.close();
    socket.addEventListener("message", async ({ data }) => {
      if (typeof data === "string") {
        trouble = JSON.parse(data).waiting ?? trouble;
        return;
      }
      const frame = frames.read(data);
      if (!frame) return;
      n += 1;
      await show(frame).catch(() => (trouble = "A picture cannot be read."));
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ ack: frame.number }));
    });
    socket.addEventListener("close", ({ code, reason }) => resolve({ n, code, reason }));
  });
}

/** Pictures one by one, for where WebSockets do not come through. */
async function byPulling() {
  const until = performance.now() + PULL_MILLIS;
  let at = null;
  let isWanted = true;
  ended = () => (isWanted = false);
  while (isWanted && performance.now() < until) {
    const begun = Date.now();
    const given = Object.fromEntries(new URLSearchParams(wishes()));
    const response = await ask(path("frame.jpg"), { ...given, at });
    const field = (name) => response.headers.get(name);
    const number = Number(field("videofields-wall-frame"));
    const millis = Date.parse(field("videofields-time"));
    const version = field("videofields-wall-version");
    const blob = await response.blob();
    await show({ number, version, millis, sentMillis: begun, rate: 0, isLive: false, blob });
    at = number + 1;
  }
}

/** Lets this screen in by the token that its address had; the daemon keeps it in a cookie that no script reads. */
async function enter() {
  if (!token) return;
  const body = JSON.stringify({ token });
  const response = await fetch("/api/v1/session", { method: "POST", body, cache: "no-store" }).catch(() => null);
  if (!response) throw new Trouble("The daemon does not answer.", 0);
  if (response.ok) return;
  const { detail } = await response.json().catch(() => ({}));
  throw new Trouble(`This screen is not let in: ${detail ?? response.status}`, 0);
}

async function run() {
  let n_failures = 0;
  await enter().catch((refusal) => (trouble = refusal.message));
  for (;;) {
    try {
      const { n, reason } = await bySocket();
      n_failures = n > 0 ? 0 : n_failures + 1;
      trouble = reason || "The connection is gone.";
      // Why it came to nothing, which a browser does not tell: who asks is a stranger, or there is no such tile.
      if (n === 0) await ask(path("frame.jpg"), { pattern: "test" });
      if (n_failures >= TRIES) await byPulling();
    } catch (error) {
      n_failures += 1;
      trouble = error instanceof Trouble ? error.message : String(error);
      if (error.status === 401) {
        trouble = "Log in at / on this machine, or give this screen a token; then it goes on.";
        await enter().catch((refusal) => (trouble = refusal.message));
      }
    }
    // Many screens that lost one daemon do not all come back at once.
    const most = Math.min(LEAST_PAUSE_MILLIS * 2 ** n_failures, MOST_PAUSE_MILLIS);
    await pause(most * (0.5 + Math.random() / 2));
  }
}

/** Says how old the picture is, where it is older than it should be. */
function tell() {
  const age = newest ? performance.now() - newest.shown : Infinity;
  const late = newest?.isLive && newest.behind > BEHIND_MILLIS ? newest.behind : 0;
  const usual = newest?.rate ? 3e3 / newest.rate : 0;
  const isStale = age > Math.max(STALE_MILLIS, usual);
  const seconds = Math.round((isStale && newest ? age + late : late) / 1e3);
  const old = seconds > 0 ? `${seconds} s old.` : "";
  state.textContent = [old, isStale ? trouble : ""].filter(Boolean).join(" ");
  state.hidden = state.textContent === "";
}

async function keepAwake() {
  if (document.hidden || !navigator.wakeLock) return;
  // Refused on battery, or where the page is not encrypted: the screen's own settings decide then.
  await navigator.wakeLock.request("screen").catch(() => {});
}

/** Lists every wall's tiles, for whoever stands before a screen to choose. */
async function choose() {
  document.getElementById("choice").hidden = false;
  const help = document.getElementById("choice-help");
  try {
    await enter();
    const { walls } = await (await ask("/api/v1/walls")).json();
    help.textContent = walls.length ? "Choose the tile that this screen shows." : "There is no wall yet.";
    for (const { id, name } of walls) {
      const { tiles } = await (await ask(`/api/v1/walls/${encodeURIComponent(id)}/tiles`)).json();
      const [title, list] = [document.createElement("h2"), document.createElement("div")];
      title.textContent = name || id;
      list.className = "tiles";
      list.append(...tiles.map((tile) => link(id, tile.id)));
      document.getElementById("walls").append(title, list);
    }
  } catch (error) {
    help.textContent = error.status === 401 ? "Log in at / first." : error.message;
  }
}

function link(wall, tile) {
  const anchor = document.createElement("a");
  anchor.href = `/wall?${new URLSearchParams({ wall, tile })}`;
  anchor.textContent = tile;
  return anchor;
}

if (wall && tile) {
  document.title = `${tile} of ${wall}`;
  document.addEventListener("visibilitychange", keepAwake);
  document.addEventListener("click", () => document.documentElement.requestFullscreen?.().catch(() => {}));
  document.addEventListener("keydown", ({ key }) => {
    const chosen = { i: "identify", t: "test", 0: "none" }[key];
    if (!chosen || chosen === pattern) return;
    pattern = chosen;
    newest = null;
    ended();
    wake();
  });
  setInterval(tell, 250);
  keepAwake();
  run();
} else {
  choose();
}
