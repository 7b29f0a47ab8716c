// What the stage shows: which camera, by which way it is calibrated, what is chosen and what is half done. What should survive a
// reload stands in the address or in the draft.

import { computed, signal } from "@preact/signals";
import { type Lens, lensOf } from "../../spatial/lens";
import { cameras as running } from "../../operate/state";
import type { Point } from "../../operate/orbit";
import { change, route } from "../../route";
import { type Calibration, type DraftCamera, base, calibratingOf, calibrationOf, draft } from "../draft";
import { type Fit, type Pixel, fit, resized, sizeOf } from "./pairs";
import type { Snap } from "./snaps";
import { first } from "./torch";

export const HOWS = ["pairs", "torch", "lines", "import"] as const;
export type How = (typeof HOWS)[number];

const detail = (name: string) => computed(() => (route.value.place === "setup" ? route.value.details[name] : undefined));
const [cameraDetail, howDetail] = [detail("camera"), detail("how")];

/** The camera that is calibrated; null where the draft has none. */
export const chosen = computed((): DraftCamera | null => {
  const all = draft.value?.cameras ?? [];
  return all.find(({ id }) => id === cameraDetail.value) ?? all[0] ?? null;
});
export const how = computed((): How => HOWS.find((known) => known === howDetail.value) ?? "pairs");

/** One side of a pair that waits for the other. */
export type Half = { readonly picture_px: Pixel; readonly place_m?: never } | { readonly place_m: Point; readonly picture_px?: never };
export const half = signal<Half | null>(null);
/** Which pair is chosen, counted from 0. */
export const selected = signal<number | null>(null);

export function choose(camera: string): void {
  [half.value, selected.value, proposal.value] = [null, null, null];
  change({ camera });
}

export function chooseHow(next: How): void {
  half.value = null;
  if (proposal.value && proposal.value.from !== "pairs") proposal.value = null;
  change({ how: next });
}

/** Sizes of the cameras' pictures, as they came. */
export const pictureSizes = signal<Readonly<Record<string, Pixel>>>({});

/** The draft's calibration of the chosen camera. */
export const calibration = computed(() => (draft.value && chosen.value ? calibrationOf(draft.value, chosen.value.id) : null));
/** Its clicked pairs and lines. */
export const calibrating = computed(() => (draft.value && chosen.value ? calibratingOf(draft.value, chosen.value.id) : null));
export const pairs = computed(() => calibrating.value?.pairs ?? []);
export const lines = computed(() => calibrating.value?.lines ?? []);

/** The size that picture points are counted in: the calibration's, else the picture's; null until one is known. */
export const size = computed((): Pixel | null => {
  if (calibration.value) return sizeOf(calibration.value);
  return (chosen.value && pictureSizes.value[chosen.value.id]) ?? null;
});

/** A calibration that was found or read, shown before it is taken over. */
export type Proposal = {
  readonly camera: string;
  readonly calibration: Calibration;
  readonly from: "pairs" | "lines" | "import";
};
export const proposal = signal<Proposal | null>(null);

/** Where a camera without a calibration stands while it is held like a torch. */
const begun = computed((): Calibration | null => {
  const [of, camera, sizePx] = [draft.value, chosen.value, size.value];
  if (!of || !camera || !sizePx || how.value !== "torch") return null;
  return first(of.scene.document, sizePx, of.cameras.findIndex(({ id }) => id === camera.id));
});

/** What is shown: what is proposed, else what the draft has, else a pose to begin with. */
export const shown = computed((): Calibration | null => {
  const offered = proposal.value;
  if (offered?.camera !== chosen.value?.id || !offered) return calibration.value ?? begun.value;
  // Pairs stay in the pixels that they were clicked in until it is taken over.
  return size.value ? resized(offered.calibration, size.value) : offered.calibration;
});
export const lens = computed((): Lens | null => (shown.value ? lensOf(shown.value) : null));
/** How well what is shown fits the pairs. */
export const fitted = computed((): Fit | null => (lens.value ? fit(lens.value, pairs.value) : null));

/** Where the pointer, or the crosshair of the keyboard, is in the picture; and what it shows there. */
export const hovered = signal<{ pixel: Pixel; place: Point | null; thing: string | null } | null>(null);
/** Where the pointer is in the scene. */
export const pointed = signal<{ place: Point; snap: Snap | null } | null>(null);

/** What is drawn into the picture beside the pairs. */
export const showsGrid = signal(true);
export const showsOutline = signal(true);
export const isEnlarged = signal(false);
export const ENLARGED = 10;

/** Whether the daemon has the camera's pictures as the draft wants them. */
export function isRunning(camera: DraftCamera): boolean {
  const known = base.value?.cameras.find(({ id }) => id === camera.id);
  const isThere = running.value?.some(({ id }) => id === camera.id) ?? false;
  return isThere && camera.isEnabled && (!known || JSON.stringify(known.source) === JSON.stringify(camera.source));
}
