// What Operate shows, as the address has it, and what was learnt of it. Everything that should survive a reload is in the address.

import { computed, signal } from "@preact/signals";
import { Trouble, api, content } from "../ask";
import { session } from "../session";
import type { components } from "../contract.gen";
import { change, route } from "../route";
import { type Point, type View, printed, read } from "./orbit";

export type Camera = components["schemas"]["Camera"];
export type Scene = { id: string; name: string; cameras: string[] };

export const ENTITIES = ["billboards", "points", "none"] as const;
export const QUALITIES = ["draft", "balanced", "exact"] as const;
export const KINDS = ["frame", "background", "mask"] as const;
export type Kind = (typeof KINDS)[number];

/** A live camera without a frame for so long is stale. */
export const STALE_AFTER_SECS = 3;
const CAMERAS_MILLIS = 1_000;
const AFTER_TROUBLE_MILLIS = 2_000;
const KEEP_VIEW_MILLIS = 300;

/** Details as they were while Operate was open: other places ask for the plan of the view. */
let kept: Readonly<Record<string, string>> = {};
const details = computed(() => {
  if (route.value.place === "operate") kept = route.value.details;
  return kept;
});
const detail = (name: string) => computed(() => details.value[name]);

export const scenes = signal<Scene[] | null>(null);
const sceneDetail = detail("scene");
export const scene = computed(() => scenes.value?.find(({ id }) => id === sceneDetail.value) ?? scenes.value?.[0] ?? null);

function oneOf<const Known extends string>(values: readonly Known[], name: string, usual: Known) {
  const text = detail(name);
  return computed(() => values.find((known) => known === text.value) ?? usual);
}

export const entities = oneOf(ENTITIES, "entities", "billboards");
export const quality = oneOf(QUALITIES, "quality", "balanced");
export const seeThrough = oneOf(["on", "off"], "see_through", "on");
export const colors = oneOf(["even", "raw"], "colors", "even");
export const kind = oneOf(KINDS, "kind", "frame");

/** The camera whose own picture is shown instead of the fused one. */
export const openedCamera = detail("camera");

/** Which time is shown, milliseconds since 1970; null is live. */
export const at = signal<number | null>(readTime(route.value.details["at"]));
/** From where the scene is seen; null until the daemon has told the scene's own view. */
export const view = signal<View | null>(read(route.value.details));
/** A world point that is marked in the fused view. */
export const mark = signal<Point | null>(null);

function readTime(text: string | undefined): number | null {
  const millis = text === undefined ? NaN : Date.parse(text);
  return Number.isFinite(millis) ? millis : null;
}

let keeping: ReturnType<typeof setTimeout> | undefined;
let isOwnView = view.value === null;

/** Puts view and time into the address. */
function keep(): void {
  clearTimeout(keeping);
  if (route.value.place !== "operate") return;
  const shown = isOwnView ? null : view.value;
  const time = at.value === null ? null : new Date(at.value).toISOString();
  change({ eye: null, target: null, fov: null, ...(shown ? printed(shown) : {}), at: time });
}

/** The same once they rest; browsers limit how often that may be done. */
function keepSoon(): void {
  clearTimeout(keeping);
  keeping = setTimeout(keep, KEEP_VIEW_MILLIS);
}

/** Takes view and time from an address that a link or the browser's buttons led to. */
export function arrived(): void {
  const { place, details } = route.value;
  if (place !== "operate") return;
  clearTimeout(keeping);
  const stood = read(details);
  isOwnView = stood === null;
  view.value = stood;
  at.value = readTime(details["at"]);
}

/** Looks from elsewhere. */
export function setView(next: View): void {
  isOwnView = false;
  view.value = next;
  keepSoon();
}

/** Takes the daemon's word for where the scene's own view is. */
export function learnView(told: View): void {
  view.value ??= told;
}

/** Back to the scene's own view. */
export function resetView(): void {
  isOwnView = true;
  view.value = null;
  keepSoon();
}

/** Shows another time. */
export function setTime(millis: number | null): void {
  at.value = millis;
  keepSoon();
}

/** Shows another scene, from its own view. */
export function showScene(id: string): void {
  change({ scene: id, camera: null, eye: null, target: null, fov: null }, true);
  isOwnView = true;
  view.value = null;
  mark.value = null;
}

/** Shows a camera's own picture; back undoes it. */
export function openCamera(id: string): void {
  keep();
  change({ camera: id }, openedCamera.value === undefined);
}

/** Shows the fused view again, from where it was left. */
export function closeCamera(): void {
  keep();
  change({ camera: null }, true);
}

/** All cameras that the viewer may see; null until they are told. */
export const cameras = signal<Camera[] | null>(null);
/** Whether what is told of cameras is of now. */
export const areCamerasOld = signal(false);

/** How a camera fares, in one word, as `state.*` has it. */
export function stateOf(camera: Camera, isOld = areCamerasOld.value): string {
  if (isOld) return "unknown";
  return camera.state === "live" && (camera.age_secs ?? 0) > STALE_AFTER_SECS ? "stale" : camera.state;
}

/** Whether an operator should look at it. */
export function isTrouble(state: string): boolean {
  return !["live", "ended"].includes(state);
}

/** Learns of scenes and cameras as long as the page is open. */
export async function follow(): Promise<never> {
  for (;;) {
    let pause = CAMERAS_MILLIS;
    if (!document.hidden && session.value?.role) {
      try {
        const told = await content(api.GET("/api/v1/cameras"));
        cameras.value = told.cameras;
        areCamerasOld.value = false;
        // A scene that was made or taken away changes the cameras' word of it.
        const named = new Set(told.cameras.flatMap((camera) => camera.scenes));
        const known = scenes.value;
        if (!known || known.length === 0 || [...named].some((id) => !known.some((one) => one.id === id))) {
          scenes.value = (await content(api.GET("/api/v1/scenes"))).scenes;
        }
      } catch (error) {
        if (error instanceof Trouble) areCamerasOld.value = true;
        pause = AFTER_TROUBLE_MILLIS;
      }
    }
    await new Promise((resolve) => setTimeout(resolve, pause));
  }
}
