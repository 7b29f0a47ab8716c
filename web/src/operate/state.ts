// What Operate shows, as the address has it, and what was learnt of it. Everything that should survive a reload is in the address.

import { computed, signal } from "@preact/signals";
import { Trouble, api, content } from "../ask";
import { session } from "../session";
import type { components } from "../contract.gen";
import { pauser } from "../pause";
import { change, route } from "../route";
import { instant, millisOf } from "./moments";
import { type Point, type View, point, printed, read } from "./orbit";
import { MODES } from "./ways";

export type Camera = components["schemas"]["Camera"];
export type Scene = { id: string; name: string; cameras: string[] };

export const ENTITIES = ["billboards", "points", "hulls", "auto", "none"] as const;
export const QUALITIES = ["draft", "balanced", "exact"] as const;
/** What is done to the picture once it is drawn: `scene` leaves it to the scene. */
export const SWITCHES = ["scene", "on", "off"] as const;
export const LIGHTS = ["scene", "off", "sky", "camera"] as const;
export const FIELDS = ["off", "normals", "montage"] as const;
export const DRAWINGS = ["auto", "server", "browser"] as const;
export const KINDS = ["frame", "background", "mask"] as const;
export type Kind = (typeof KINDS)[number];

export const MAPS = ["inset", "large", "off"] as const;
export const SIDES = ["cameras", "people", "views", "keep"] as const;

/** A live camera without a frame for so long is stale. */
export const STALE_AFTER_SECS = 3;
const CAMERAS_MILLIS = 1_000;
const AFTER_TROUBLE_MILLIS = 2_000;
const KEEP_VIEW_MILLIS = 300;
const KEEP_AT_LEAST_MILLIS = 2_000;

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
/** Who draws: `auto` leaves it to what the browser can do. */
export const drawing = oneOf(DRAWINGS, "drawing", "auto");
export const colors = oneOf(["even", "raw"], "colors", "even");
export const occlusion = oneOf(SWITCHES, "occlusion", "scene");
export const relight = oneOf(LIGHTS, "relight", "scene");
export const stipple = oneOf(SWITCHES, "stipple", "scene");
/** How cameras' colours are mixed where they meet. */
export const fields = oneOf(FIELDS, "fields", "off");
/** Those that are not left to the scene, as requests have them; and fields, which only the daemon draws as well. */
export const effects = computed((): Readonly<Record<string, string>> => {
  const chosen = { occlusion: occlusion.value, relight: relight.value, stipple: stipple.value };
  const asked = Object.entries(chosen).filter(([, value]) => value !== "scene");
  return Object.fromEntries(fields.value === "off" ? asked : [...asked, ["fields", fields.value]]);
});
export const kind = oneOf(KINDS, "kind", "frame");
/** How pointer and keys move the viewer. */
export const mode = oneOf(MODES, "move", "orbit");
export const map = oneOf(MAPS, "map", "inset");
/** What stands beside the picture. */
export const side = oneOf(SIDES, "side", "cameras");
/** Whether ids, and where people came from, are drawn over the picture. */
export const labels = oneOf(["on", "off"], "labels", "on");
export const trails = oneOf(["on", "off"], "trails", "on");
/** Whom the view keeps in the middle. */
export const followed = detail("follow");

/** The camera whose own picture is shown instead of the fused one. */
export const openedCamera = detail("camera");

/** Which time is shown, milliseconds since 1970; null is live. */
export const at = signal<number | null>(readTime(route.value.details["at"]));
/** From where the scene is seen; null until the daemon has told the scene's own view. */
export const view = signal<View | null>(read(route.value.details));
/** On the way to another view: shown in its place, and never in the address. */
export const flight = signal<View | null>(null);
/** From where the scene is seen at this moment. */
export const looking = computed(() => flight.value ?? view.value);
/** A world point that is marked in the fused view and on the map, and of which is told who sees it. */
export const mark = signal<Point | null>(point(route.value.details["mark"]));

/** The picture that is on the screen, as whoever draws it tells: its instant, the times of the frames in it by camera, and, of a
 * fused one, from where it is seen. */
export type Shown = { readonly millis: number; readonly frames: ReadonlyMap<string, number>; readonly view: View | null };
export const shownFused = signal<Shown | null>(null);
export const shownAlone = signal<Shown | null>(null);
export const shown = computed(() => (openedCamera.value === undefined ? shownFused.value : shownAlone.value));

function readTime(text: string | undefined): number | null {
  const millis = millisOf(text);
  return Number.isFinite(millis) ? millis : null;
}

let [wishedAt, keptAt] = [-Infinity, -Infinity];
let keeping: ReturnType<typeof setTimeout> | undefined;
let isOwnView = view.value === null;

/** Puts view and time into the address. */
function keep(): void {
  clearTimeout(keeping);
  keptAt = performance.now();
  if (route.value.place !== "operate") return;
  const kept = isOwnView ? null : view.value;
  const time = at.value === null ? null : instant(at.value);
  const place = mark.value === null ? null : mark.value.map((metres) => metres.toFixed(2)).join(",");
  change({ eye: null, target: null, fov: null, ...(kept ? printed(kept) : {}), at: time, mark: place });
}

/** The same, at once after a rest, and else once they rest again or now and then: browsers limit how often that may be done. */
function keepSoon(): void {
  const now = performance.now();
  const isFirst = now - wishedAt > KEEP_VIEW_MILLIS;
  wishedAt = now;
  clearTimeout(keeping);
  if (isFirst || now - keptAt > KEEP_AT_LEAST_MILLIS) keep();
  else keeping = setTimeout(keep, KEEP_VIEW_MILLIS);
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
  mark.value = point(details["mark"]);
  flight.value = null;
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

/** Marks a place in the world, or none. */
export function setMark(place: Point | null): void {
  mark.value = place;
  keepSoon();
}

/** Follows somebody, or nobody any more. */
export function setFollowed(id: string | null): void {
  change({ follow: id });
}

/** Chooses one of a few; the usual one does not stand in the address. */
export function choose(name: string, value: string, usual: string): void {
  change({ [name]: value === usual ? null : value });
}

/** Goes to another time; it is in the address at once. */
export function jumpTo(millis: number | null): void {
  at.value = millis;
  keep();
}

/** Shows another time on the way to others. */
export function setTime(millis: number | null): void {
  at.value = millis;
  keepSoon();
}

/** Shows another scene, from its own view. */
export function showScene(id: string): void {
  change({ scene: id, camera: null, follow: null, mark: null, eye: null, target: null, fov: null }, true);
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

/** What people call a camera. */
export function nameOf(id: string): string {
  return cameras.value?.find((camera) => camera.id === id)?.name ?? id;
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

async function learnScenes(): Promise<void> {
  scenes.value = (await content(api.GET("/api/v1/scenes"))).scenes;
}

async function learnCameras(): Promise<void> {
  cameras.value = (await content(api.GET("/api/v1/cameras"))).cameras;
  areCamerasOld.value = false;
}

/** A scene that was made or taken away changes the cameras' word of it. */
function areScenesKnown(): boolean {
  const known = new Set(scenes.value?.map(({ id }) => id));
  return known.size > 0 && (cameras.value ?? []).every((camera) => camera.scenes.every((id) => known.has(id)));
}

/** Learns of scenes and cameras as long as the page is open, from the moment on that it is known who looks. */
export async function follow(): Promise<never> {
  const rest = pauser();
  const isKnown = computed(() => (session.value?.role ?? null) !== null);
  isKnown.subscribe(rest.wake);
  for (;;) {
    let pause = CAMERAS_MILLIS;
    if (!document.hidden && isKnown.peek()) {
      try {
        // Both at once at first: the first picture waits for the scene's name alone.
        const isFirst = scenes.value === null;
        await Promise.all([learnCameras(), isFirst && learnScenes()]);
        if (!isFirst && !areScenesKnown()) await learnScenes();
      } catch (error) {
        if (error instanceof Trouble) areCamerasOld.value = true;
        pause = AFTER_TROUBLE_MILLIS;
      }
    }
    await rest.pause(pause);
  }
}
