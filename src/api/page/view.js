// The fused view: asks for one picture after another from where the viewer stands, and moves the viewer.

import { ask, pauser, seen, show } from "/ask.js";
import { moved, nearer, placed, turned } from "/orbit.js";

const INTERVAL_MILLIS = 250;
const MOVING_INTERVAL_MILLIS = 40;
const AFTER_TROUBLE_MILLIS = 1500;
const STILL_AFTER_MILLIS = 350;
const MOST_COLUMNS = 1600;

const stage = document.querySelector("#stage");
const picture = document.querySelector("#fused");
const spot = document.querySelector("#spot");
const old = document.querySelector("#old");
const fact = (name) => document.querySelector(`#fact-${name}`);
const rest = pauser();

/** What is asked for; `view` is null until the daemon told the scene's own. */
const wanted = { scene: null, entities: "billboards", view: null };
let marked = null;
let movedAt = -Infinity;
let recent = [];

/** Shows another scene from its own view. */
export function showScene(scene) {
  Object.assign(wanted, { scene, view: null });
  mark(null);
}

/** Draws moving things in another way. */
export function showEntities(style) {
  wanted.entities = style;
  rest.wake();
}

/** Marks a world point, [x, y, z] in metres, or none. */
export function mark(point) {
  marked = point;
  drawMark(wanted.view);
}

/** Back to the scene's own view. */
export function resetView() {
  move(() => null);
}

/** Asks for pictures as long as the page is open; `report` hears of every success (null) and trouble. */
export async function run(report) {
  for (;;) {
    await seen();
    const start = performance.now();
    const isMoving = start - movedAt < STILL_AFTER_MILLIS;
    let pause = isMoving ? MOVING_INTERVAL_MILLIS : INTERVAL_MILLIS;
    try {
      if (wanted.scene) await refresh(isMoving);
      showAge(false);
      report(null);
    } catch (trouble) {
      if (trouble.status === 400 && !wanted.view) wanted.view = await guessed(wanted.scene);
      showAge(true);
      report(trouble);
      pause = AFTER_TROUBLE_MILLIS;
    }
    await rest.pause(Math.max(0, pause - (performance.now() - start)));
  }
}

function showAge(isOld) {
  old.hidden = !isOld;
  stage.classList.toggle("is-old", isOld);
}

async function refresh(isMoving) {
  const { scene, entities, view } = wanted;
  const scale = Math.min(window.devicePixelRatio, MOST_COLUMNS / stage.clientWidth) * (isMoving ? 0.5 : 1);
  const start = performance.now();
  const response = await ask(`/api/v1/scenes/${scene.id}/view.jpg`, {
    width: Math.max(16, Math.round(stage.clientWidth * scale)),
    height: Math.max(16, Math.round(stage.clientHeight * scale)),
    eye: view && view.eye.map(rounded).join(","),
    target: view && view.target.map(rounded).join(","),
    fov: view?.fov,
    entities,
  });
  if (scene !== wanted.scene) return;
  const told = readView(response.headers.get("Videofields-View"));
  wanted.view ??= view ? wanted.view : told;
  await show(picture, response);
  stage.classList.add("has-picture");
  picture.alt = `${scene.name} as all cameras together see it`;
  drawMark(view ?? told);
  tell(response.headers, performance.now() - start);
}

const rounded = (metres) => Number(metres.toFixed(4));

function readView(text) {
  if (!text) return null;
  const parts = Object.fromEntries(text.split(";").map((part) => part.split("=")));
  const point = (numbers) => numbers.split(",").map(Number);
  return { eye: point(parts.eye), target: point(parts.target), fov: Number(parts.fov) };
}

/** A view of a scene that has none of its own: from above, around what its cameras see. */
async function guessed(scene) {
  const points = [];
  for (const camera of scene.cameras) {
    const place = { u: 0.5, v: 0.75, scene: scene.id };
    const located = await ask(`/api/v1/cameras/${camera}/locate`, place).catch(() => null);
    if (located) points.push((await located.json()).point_m);
  }
  if (points.length === 0) return null;
  const target = [0, 1, 2].map((i) => points.reduce((sum, point) => sum + point[i], 0) / points.length);
  return { eye: [target[0], target[1] - 20, target[2] + 12], target, fov: 50 };
}

function drawMark(view) {
  const place = view && marked && placed(view, stage.clientWidth / stage.clientHeight, marked);
  spot.hidden = !place;
  if (place) Object.assign(spot.style, { left: `${place[0] * 100}%`, top: `${place[1] * 100}%` });
}

function tell(headers, millis) {
  const time = headers.get("Videofields-Time") ?? "";
  const instant = Date.parse(time);
  fact("time").textContent = time.replace("T", " ").replace(/(\.\d{3})\d*/, "$1").replace("Z", " UTC");
  const sources = (headers.get("Videofields-Sources") ?? "").split(",").filter(Boolean);
  const told = sources.map((source) => {
    const [camera, seenAt] = source.split("=");
    const behind = (instant - Date.parse(seenAt)) / 1000;
    return behind > 0.05 ? `${camera} (${behind.toFixed(1)} s behind)` : camera;
  });
  fact("sources").textContent = told.join(", ") || "no camera has a frame for it";
  fact("plan").textContent = (headers.get("Videofields-Plan") ?? "").replaceAll(",", ", ") || "none";
  recent = [...recent, performance.now()].slice(-9);
  const rate = recent.length > 1 ? ((recent.length - 1) * 1000) / (recent.at(-1) - recent[0]) : 0;
  const stages = (headers.get("Server-Timing") ?? "").replaceAll(";dur=", " ").replace(/(\d\.\d)\d+/g, "$1");
  fact("timing").textContent = `${millis.toFixed(0)} ms (${stages}); ${rate.toFixed(1)} pictures a second`;
}

function move(change) {
  if (!wanted.view) return;
  wanted.view = change(wanted.view);
  movedAt = performance.now();
  rest.wake();
  clearTimeout(move.timer);
  move.timer = setTimeout(rest.wake, STILL_AFTER_MILLIS);
}

// Pointers: one turns (with shift or another button moves), two move and pinch.
const pointers = new Map();
stage.addEventListener("pointerdown", (event) => {
  stage.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
});
stage.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
  const now = [event.clientX, event.clientY];
  pointers.set(event.pointerId, now);
  const [dx, dy] = [0, 1].map((i) => (now[i] - before[i]) / stage.clientHeight);
  if (others.length > 0) {
    const apart = (place) => Math.max(10, Math.hypot(place[0] - others[0][0], place[1] - others[0][1]));
    move((view) => nearer(moved(view, -dx / 2, dy / 2), apart(before) / apart(now)));
  } else if (event.shiftKey || event.buttons > 1) {
    move((view) => moved(view, -dx, dy));
  } else {
    move((view) => turned(view, -dx * 3, dy * 3));
  }
});
for (const over of ["pointerup", "pointercancel"]) {
  stage.addEventListener(over, (event) => pointers.delete(event.pointerId));
}
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30);
    move((view) => nearer(view, Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015)));
  },
  { passive: false },
);

const KEYS = {
  ArrowLeft: (view, shift) => (shift ? moved(view, -0.05, 0) : turned(view, -0.06, 0)),
  ArrowRight: (view, shift) => (shift ? moved(view, 0.05, 0) : turned(view, 0.06, 0)),
  ArrowUp: (view, shift) => (shift ? moved(view, 0, 0.05) : turned(view, 0, 0.04)),
  ArrowDown: (view, shift) => (shift ? moved(view, 0, -0.05) : turned(view, 0, -0.04)),
  "+": (view) => nearer(view, 0.9),
  "=": (view) => nearer(view, 0.9),
  "-": (view) => nearer(view, 1 / 0.9),
  0: () => null,
};
stage.addEventListener("keydown", (event) => {
  const key = KEYS[event.key];
  if (!key || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  move((view) => key(view, event.shiftKey));
});
