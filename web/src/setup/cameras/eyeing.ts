// From where the scene is seen: in three dimensions, or from straight above as a map, which is a view from far away through a narrow
// angle so that everything is drawn by the same means.

import { computed, signal } from "@preact/signals";
import type { Point, View } from "../../operate/orbit";
import { fovDeg } from "../../spatial/lens";
import { viewEye } from "../geometry/eye";
import type { Pixel } from "./pairs";
import { how, lens } from "./now";
import { document } from "./scene";
import { add, extent, point } from "./torch";

export const SIGHTS = ["space", "map"] as const;
export type Sight = (typeof SIGHTS)[number];
export type Map = { readonly center: readonly [number, number]; readonly across_m: number };

const MAP_FOV_DEG = 2;
const FOV_DEG = 45;
const ACROSS_M = [0.5, 50_000] as const;
/** How far ahead of a camera that is looked through the viewer turns about. */
const AHEAD_M = 12;

export const sight = signal<Sight>("space");
/** Where the viewer stands by choice; null where the scene says. */
const chosenView = signal<View | null>(null);
const chosenMap = signal<Map | null>(null);
export const screen = signal<Pixel | null>(null);

/** The scene's own view; else, and where the camera itself is to be seen, all of the ground from the south and above. */
function usual(): View {
  const { view } = document.value;
  if (view && how.value !== "torch") return { eye: point(view.eye_m), target: point(view.target_m), fov: view.fov_deg ?? FOV_DEG };
  const { low, high, level_m } = extent(document.value);
  const middle: Point = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, level_m];
  const size = Math.max(high[0] - low[0], high[1] - low[1], 1);
  return { eye: add(middle, [0, -1.05 * size, 0.7 * size]), target: middle, fov: FOV_DEG };
}

const map = computed((): Map => {
  if (chosenMap.value) return chosenMap.value;
  const { low, high } = extent(document.value);
  const [width, height] = screen.value ?? [1, 1];
  const aspect = width / Math.max(height, 1);
  return { center: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], across_m: Math.max(high[1] - low[1], (high[0] - low[0]) / aspect, 1) * 1.12 };
});

function fromAbove({ center: [x, y], across_m }: Map): View {
  const { level_m } = extent(document.value);
  const height = across_m / 2 / Math.tan((MAP_FOV_DEG * Math.PI) / 360);
  return { eye: [x, y, level_m + height], target: [x, y, level_m], fov: MAP_FOV_DEG };
}

export const view = computed((): View => (sight.value === "map" ? fromAbove(map.value) : (chosenView.value ?? usual())));
/** How places and pixels of the pane belong together. */
export const eye = computed(() => (screen.value && screen.value[0] > 0 ? viewEye(view.value, screen.value) : null));

export function look(next: View): void {
  if (sight.value === "space") chosenView.value = next;
}

export function reset(): void {
  [chosenView.value, chosenMap.value] = [null, null];
}

/** Moves the map by pixels of the screen. */
export function panMap([dx, dy]: Pixel): void {
  const { center: [x, y], across_m } = map.value;
  const scale = across_m / Math.max(screen.value?.[1] ?? 1, 1);
  chosenMap.value = { center: [x - dx * scale, y + dy * scale], across_m };
}

/** Enlarges the map; what lies under a point of the screen stays there. */
export function zoomMap(factor: number, under: Pixel | null = null): void {
  const { center: [x, y], across_m } = map.value;
  const next = Math.min(Math.max(across_m / factor, ACROSS_M[0]), ACROSS_M[1]);
  const [width, height] = screen.value ?? [1, 1];
  const [dx, dy] = under ? [under[0] - width / 2, height / 2 - under[1]] : [0, 0];
  const shift = (across_m - next) / height;
  chosenMap.value = { center: [x + dx * shift, y + dy * shift], across_m: next };
}

/** Looks as the camera does. */
export function lookThrough(): void {
  const of = lens.value;
  if (!of) return;
  sight.value = "space";
  chosenView.value = { eye: of.position, target: add(of.position, of.axes[2], AHEAD_M), fov: fovDeg(of) };
}
