// What of the stage Geometry is chosen and shown. What should survive reloading stands in the address; the things themselves stand in
// the draft, and while something is dragged in `preview`, so that a drag is one step and Escape leaves no trace.

import { computed, signal } from "@preact/signals";
import type { View } from "../../operate/orbit";
import { change, route } from "../../route";
import { type SceneDocument, draft } from "../draft";
import { type Frame, boundsOf, fitted } from "../plan/frame";
import type { Guide } from "./snapping";
import { type FileExtents, extentOf, ids, things } from "./things";
import { DRAWN, type Drawing } from "./tools/drawing";

export const TOOLS = ["select", ...DRAWN] as const;
export type Tool = (typeof TOOLS)[number];
export const LAYOUTS = ["map", "both", "view"] as const;
export type Layout = (typeof LAYOUTS)[number];
export const GRIDS = ["0", "0.1", "0.5", "1"] as const;
export type Grid = (typeof GRIDS)[number];
/** How much is seen of what stands; what is less opaque shows what cameras see behind it. */
export const OPACITIES = ["1", "0.6", "0.25"] as const;
export type Opacity = (typeof OPACITIES)[number];

/** What the address says, if it is one of these. */
function named<Value extends string>(key: string, values: readonly Value[], usual: Value) {
  return computed(() => values.find((value) => value === route.value.details[key]) ?? usual);
}

export function setNamed(key: "layout" | "grid" | "opacity" | "live", value: string): void {
  change({ [key]: value });
}

/** There is room for both on screens that are wide enough. */
const isNarrow = typeof matchMedia !== "undefined" && matchMedia("(max-width: 999px)").matches;
export const layout = named<Layout>("layout", LAYOUTS, isNarrow ? "map" : "both");
export const gridName = named<Grid>("grid", GRIDS, "0.1");
export const grid = computed(() => Number(gridName.value));
export const opacityName = named<Opacity>("opacity", OPACITIES, "1");
/** Which of the cameras' pictures are shown on what is drawn: as they come, without what moves, none. */
export const LIVES = ["frame", "background", "off"] as const;
export type Live = (typeof LIVES)[number];
export const liveName = named<Live>("live", LIVES, "background");

export const tool = signal<Tool>("select");
export const drawing = signal<Drawing | null>(null);
/** The document while something is dragged. */
export const preview = signal<SceneDocument | null>(null);
const EMPTY: SceneDocument = { version: 1 };
/** The document as it is shown. */
export const shown = computed(() => preview.value ?? draft.value?.scene.document ?? EMPTY);

function listed(key: string): readonly string[] {
  return (route.value.details[key] ?? "").split(",").filter(Boolean);
}

/** Ids of the chosen things. */
export const chosen = computed(() => {
  const there = ids(shown.value);
  return listed("thing").filter((id) => there.includes(id));
});
/** Whether the sky is what the panel shows. */
export const isSkyChosen = computed(() => route.value.details["thing"] === "sky" && !ids(shown.value).includes("sky"));
/** Ids of things that are not shown while one edits. */
export const hidden = computed<ReadonlySet<string>>(() => new Set(listed("hide")));

export function choose(of: readonly string[]): void {
  change({ thing: of.length > 0 ? of.join(",") : null });
}

/** Adds a thing to the chosen ones, or takes it out. */
export function toggle(id: string): void {
  choose(chosen.value.includes(id) ? chosen.value.filter((other) => other !== id) : [...chosen.value, id]);
}

export function setHidden(of: readonly string[], isHidden: boolean): void {
  const rest = [...hidden.value].filter((id) => !of.includes(id));
  const next = isHidden ? [...rest, ...of] : rest;
  change({ hide: next.length > 0 ? next.join(",") : null });
}

/** What the last movement came to lie on, and how high. */
export const guides = signal<{ readonly lines: readonly Guide[]; readonly height: number }>({ lines: [], height: 0 });
/** What the pointer would grasp, as its shape tells. */
export const grasp = signal<"default" | "grab" | "move" | "pointer">("default");
export const cursor = computed(() => (tool.value === "select" ? grasp.value : "crosshair"));
/** What was just done or refused, for who sees the stage and who hears it. */
export const said = signal("");
/** What is known of the models' files. */
export const fileExtents = signal<FileExtents>(new Map());

/** All that is there, as the map shows it at first. */
export function wholeFrame(size_px: Frame["size_px"]): Frame {
  const { ground = [], cameras = [] } = shown.value;
  const places = [
    ...ground.flatMap(({ polygon }) => polygon),
    ...things(shown.value).flatMap((one) => extentOf(one, fileExtents.value).outline),
    ...cameras.flatMap(({ calibration }) => ("position_m" in calibration ? [calibration.position_m] : [])),
  ];
  return fitted(boundsOf(places), size_px);
}

/** What the map shows; null until it was shown. Kept while other stages are open. */
export const frame = signal<Frame | null>(null);
/** Where the view looks from; null until it was moved. */
export const view = signal<View | null>(null);

/** Shows everything, on the map and in the view. */
export function showAll(): void {
  view.value = null;
  if (frame.value) frame.value = wholeFrame(frame.value.size_px);
}

let lastScene: string | null = null;

/** What another scene's map and view showed is nothing here. */
export function beginScene(id: string): void {
  if (lastScene !== null && lastScene !== id) {
    view.value = null;
    frame.value = null;
  }
  lastScene = id;
}
