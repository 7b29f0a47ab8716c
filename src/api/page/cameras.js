// The cameras: their pictures, how they fare, and where a chosen place of a picture lies in the world.

import { ask, pauser, seen, show } from "/ask.js";

const INTERVAL_MILLIS = 500;
const AFTER_TROUBLE_MILLIS = 2000;
const STALE_AFTER_SECS = 3;

const list = document.querySelector("#cameras");
const template = document.querySelector("#camera");
const rest = pauser();
const cards = new Map();
let kind = "frame";

/** Shows another picture of every camera: frame, background or mask. */
export function showKind(next) {
  kind = next;
  rest.wake();
}

/** Asks for states and pictures as long as the page is open; `onLocated` hears of world points, or of null. */
export async function run(sceneOf, onLocated, report) {
  for (;;) {
    await seen();
    const start = performance.now();
    let pause = INTERVAL_MILLIS;
    try {
      const { cameras } = await (await ask("/api/v1/cameras")).json();
      for (const camera of cameras) update(camera, sceneOf, onLocated);
      for (const [id, card] of cards) {
        if (!cameras.some((camera) => camera.id === id)) remove(id, card);
      }
      for (const card of cards.values()) await refresh(card);
      report(null);
    } catch (trouble) {
      for (const card of cards.values()) showState(card, "unknown", "no word from the daemon");
      report(trouble);
      pause = AFTER_TROUBLE_MILLIS;
    }
    await rest.pause(Math.max(0, pause - (performance.now() - start)));
  }
}

function remove(id, card) {
  card.element.remove();
  cards.delete(id);
}

function update(camera, sceneOf, onLocated) {
  let card = cards.get(camera.id);
  if (!card) {
    card = make(camera, sceneOf, onLocated);
    cards.set(camera.id, card);
    list.append(card.element);
  }
  card.camera = camera;
  const isStale = camera.state === "live" && (camera.age_secs ?? 0) > STALE_AFTER_SECS;
  const state = isStale ? "stale" : camera.state;
  showState(card, state, isStale ? `no new frame for ${duration(camera.age_secs)}` : state);
  card.part("h3").textContent = camera.name;
  const reason = card.part(".reason");
  reason.hidden = !camera.reason;
  reason.textContent = camera.reason ?? "";
  card.part(".counts").textContent = counts(camera);
}

function showState(card, state, saying) {
  card.element.dataset.state = state;
  card.part(".badge").textContent = state;
  const veil = card.part(".veil");
  veil.hidden = state === "live" || state === "ended";
  veil.textContent = saying;
}

function counts(camera) {
  if (!camera.size_px) return "no frame yet";
  const facts = [`${camera.size_px[0]} × ${camera.size_px[1]}`, `${camera.frames} frames`];
  if (camera.dropped > 0) facts.push(`${camera.dropped} dropped`);
  if (camera.age_secs !== null) facts.push(`newest ${duration(camera.age_secs)} ago`);
  return facts.join(" · ");
}

function duration(secs) {
  if (secs < 100) return `${secs.toFixed(1)} s`;
  return secs < 6000 ? `${(secs / 60).toFixed(0)} min` : `${(secs / 3600).toFixed(0)} h`;
}

/** The newest picture of a card, unless it is the one shown already. */
async function refresh(card) {
  const { camera } = card;
  const shown = `${kind} ${camera.frames}`;
  if (!camera.size_px || card.shown === shown) return;
  const image = card.part("img");
  try {
    await show(image, await ask(`/api/v1/cameras/${camera.id}/${kind}.${kind === "mask" ? "png" : "jpg"}`));
    image.alt = `${kind} of camera ${camera.name}`;
    card.shown = shown;
  } catch (trouble) {
    // A camera that loses its frames says so in its state; only silence concerns the whole page.
    if (trouble.status === 0) throw trouble;
  }
}

function make(camera, sceneOf, onLocated) {
  const element = template.content.firstElementChild.cloneNode(true);
  const part = (selector) => element.querySelector(selector);
  const card = { element, part, camera, shown: null, place: [0.5, 0.5] };
  const button = part(".picture");
  button.setAttribute("aria-label", `Picture of camera ${camera.name}: arrow keys choose a place, Enter locates it`);
  const point = () => {
    const spot = part(".spot");
    spot.hidden = false;
    Object.assign(spot.style, { left: `${card.place[0] * 100}%`, top: `${card.place[1] * 100}%` });
  };
  button.addEventListener("click", async (event) => {
    // A click made by a key has no place of its own: the spot's is taken.
    if (event.detail > 0) {
      const box = button.getBoundingClientRect();
      const share = (value, start, extent) => Math.min(Math.max((value - start) / extent, 0), 1);
      card.place = [share(event.clientX, box.left, box.width), share(event.clientY, box.top, box.height)];
    }
    point();
    onLocated(await locate(card, sceneOf()));
  });
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  button.addEventListener("keydown", (event) => {
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    card.place = card.place.map((share, i) => Math.min(Math.max(share + step[i] * 0.02, 0), 1));
    point();
  });
  return card;
}

async function locate(card, scene) {
  const located = card.part(".located");
  const [u, v] = card.place.map((share) => share.toFixed(5));
  const isThere = scene && card.camera.scenes.includes(scene.id);
  try {
    const path = `/api/v1/cameras/${card.camera.id}/locate`;
    const place = await (await ask(path, { u, v, scene: isThere ? scene.id : null })).json();
    const [x, y, z] = place.point_m.map((metres) => metres.toFixed(2));
    const angle = ((place.theta_rad * 180) / Math.PI).toFixed(1);
    const doubt = place.reliable ? "" : ", grazing: not reliable";
    located.textContent =
      `x ${x}, y ${y}, z ${z} m on ${place.surface} ${place.surface_idx}; ` +
      `seen at ${angle}°, ${(place.footprint_m * 100).toFixed(1)} cm a pixel${doubt}`;
    return isThere ? place.point_m : null;
  } catch (trouble) {
    located.textContent = trouble.message;
    return null;
  }
}
