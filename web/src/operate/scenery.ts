// What stands in the scene that is shown: its document, the cameras' lenses, and where rays of a view end. The three-dimensional
// part is loaded once the first picture is there, since pictures do not need it.

import { computed, effect, signal } from "@preact/signals";
import { ask } from "../ask";
import { type Lens, type Ray, footprint, lensOf, meetLevel } from "../spatial/lens";
import type { SceneDocument, Surfaces } from "../spatial/surfaces";
import { type Point, type View, axes, toward } from "./orbit";
import * as state from "./state";

const AGAIN_MILLIS = 20_000;
/** Beyond this nothing of the ground is looked for. */
const FARTHEST_M = 2_000;
/** A camera's cone on the map reaches no farther than so many times the scene's extent. */
const CONE_REACH = 0.9;

export const sceneDocument = signal<SceneDocument | null>(null);
const surfaces = signal<Surfaces | null>(null);

/** The lenses of the scene's calibrated cameras, by id. */
export const lenses = computed(() => {
  const found = new Map<string, Lens>();
  for (const { id, calibration } of sceneDocument.value?.cameras ?? []) if (!("import" in calibration)) found.set(id, lensOf(calibration));
  return found;
});

/** Low and high corner of the ground, x and y. */
export const extent = computed((): { low: readonly [number, number]; high: readonly [number, number] } => {
  const corners = [...outline(sceneDocument.value), ...[...lenses.value.values()].map(({ position }) => [position[0], position[1]] as const)];
  if (corners.length === 0) return { low: [-20, -20], high: [20, 20] };
  const of = (pick: (...numbers: number[]) => number, i: 0 | 1) => pick(...corners.map((corner) => corner[i]));
  return { low: [of(Math.min, 0), of(Math.min, 1)], high: [of(Math.max, 0), of(Math.max, 1)] };
});

function outline(scene: SceneDocument | null): (readonly [number, number])[] {
  const level = (scene?.ground ?? []).flatMap(({ polygon }) => polygon.map(([x = 0, y = 0]) => [x, y] as const));
  const uneven = (scene?.height_fields ?? []).flatMap(({ low_m: [x = 0, y = 0], step_m, columns, heights_m }) => {
    const rows = heights_m.length / columns;
    return [[x, y], [x + step_m * (columns - 1), y + step_m * (rows - 1)]] as const;
  });
  return [...level, ...uneven];
}

/** The ground's height where nothing better is known: the first ground's. */
const usualLevel = computed(() => sceneDocument.value?.ground?.[0]?.height_m ?? 0);

/** What every calibrated camera sees of the ground, as corners on it. */
export const cones = computed(() => {
  const { low, high } = extent.value;
  const reach = Math.max(10, Math.hypot(high[0] - low[0], high[1] - low[1]) * CONE_REACH);
  return new Map([...lenses.value].map(([id, lens]) => [id, footprint(lens, usualLevel.value, reach, 12)] as const));
});

/** Keeps all this up to date until the answered function is called. */
export function attend(): () => void {
  const ending = new AbortController();
  let tag: string | null = null;
  let known = "";
  const learn = async () => {
    const id = state.scene.value?.id;
    if (id === undefined || document.hidden) return;
    try {
      const response = await ask(`/api/v1/scenes/${encodeURIComponent(id)}`, {}, { signal: ending.signal, tag: known === id ? tag : null });
      if (response.status === 304 || id !== state.scene.value?.id) return;
      [known, tag] = [id, response.headers.get("ETag")];
      sceneDocument.value = (await response.json()) as SceneDocument;
    } catch {
      // The bar at the top says that nothing is answered; the map keeps what it knew.
    }
  };
  const stopLearning = effect(() => {
    if (state.scene.value?.id !== known) sceneDocument.value = null;
    void learn();
  });
  const timer = setInterval(() => void learn(), AGAIN_MILLIS);
  const stopBuilding = effect(() => {
    // Afterwards, so that the first picture comes first.
    if (sceneDocument.value && state.shown.value) void build(sceneDocument.value, ending.signal);
  });
  return () => {
    ending.abort();
    clearInterval(timer);
    stopLearning();
    stopBuilding();
    surfaces.peek()?.dispose();
    surfaces.value = null;
  };
}

let built: SceneDocument | null = null;

async function build(scene: SceneDocument, signal: AbortSignal): Promise<void> {
  if (built === scene && surfaces.peek()) return;
  built = scene;
  const { surfacesOf } = await import("../spatial/surfaces");
  if (signal.aborted || built !== scene) return;
  const before = surfaces.peek();
  if (before) before.update(scene);
  else surfaces.value = surfacesOf(scene);
}

/** Where a ray of the world ends; on the level ground as long as the scene's surfaces are being loaded. */
function met(through: Ray): Point | null {
  const picked = surfaces.peek()?.pick(through);
  if (picked) return picked.point_m;
  if (surfaces.peek()) return null;
  const point = meetLevel(through, usualLevel.peek());
  return point && Math.hypot(point[0] - through.origin[0], point[1] - through.origin[1]) < FARTHEST_M ? point : null;
}

/** What is shown at a place of the picture, shares of width and height; null for the sky. */
export function placeAt(view: View, aspect: number, place: readonly [number, number]): Point | null {
  return met({ origin: view.eye, direction: toward(view, aspect, place) });
}

/** The height of what one would stand on there, coming from `above`. */
export function groundAt(x: number, y: number, above: number): number {
  const below = met({ origin: [x, y, above], direction: [0, 0, -1] });
  return below ? below[2] : usualLevel.peek();
}

/** How many pixels of a camera's picture a metre has at a place; 0 where it lies outside it. What stands between is left out. */
export function pixelsPerMetre(camera: string, place: Point): number {
  const lens = lenses.peek().get(camera);
  if (!lens) return 1;
  const away = Math.hypot(place[0] - lens.position[0], place[1] - lens.position[1], place[2] - lens.position[2]);
  return (lens.focal[1] * lens.size[1]) / Math.max(away, 0.1);
}

/** How a viewer at a camera's place sees what it sees. */
export function viewOf(camera: string, fovDeg: (lens: Lens) => number): View | null {
  const lens = lenses.peek().get(camera);
  if (!lens) return null;
  const [, , forward] = lens.axes;
  const far = met({ origin: lens.position, direction: forward });
  const away = far ? Math.hypot(far[0] - lens.position[0], far[1] - lens.position[1], far[2] - lens.position[2]) : 10;
  const target: Point = [lens.position[0] + forward[0] * away, lens.position[1] + forward[1] * away, lens.position[2] + forward[2] * away];
  const view = { eye: lens.position, target, fov: Math.min(fovDeg(lens), 120) };
  return axes(view).forward.every(Number.isFinite) ? view : null;
}
