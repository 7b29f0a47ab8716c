// The cameras' pictures on what is drawn, so that one fits a box to the building that a video shows. Map and view show the same
// pictures, which are asked for once.

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { type CameraTexture, liveTexture, stillTexture } from "../../spatial/cameraTextures";
import { type Calibration, type Lens, lensOf } from "../../spatial/lens";
import { Projection, type Projector } from "../../spatial/projection";
import type { Surfaces } from "../../spatial/surfaces";
import type { Stage } from "../../spatial/Viewport";
import { type Draft, type DraftCamera, base, calibrationOf, draft } from "../draft";
import { look } from "../requests";
import { type Live, liveName } from "./state";

const FRAME_MILLIS = 2_000;
const BACKGROUND_MILLIS = 15_000;

type Held = { readonly texture: Promise<CameraTexture | null>; users: number };
const pool = new Map<string, Held>();
/** Stages that are drawn anew when a picture comes. */
const stages = new Set<Stage>();
/** Counts pictures that began to be there. */
const came = signal(0);
const lenses = new WeakMap<Calibration, Lens | null>();

const redraw = () => stages.forEach((stage) => stage.redraw());

function lensFor(calibration: Calibration): Lens | null {
  const known = lenses.get(calibration);
  if (known !== undefined) return known;
  let lens: Lens | null = null;
  try {
    lens = lensOf(calibration);
  } catch {
    // A lens model that is none projects nothing.
  }
  lenses.set(calibration, lens);
  return lens;
}

/** A camera that the daemon runs tells its pictures itself; of one that is not kept yet, one look at its source has to do. */
async function textureOf(camera: DraftCamera, what: Exclude<Live, "off">): Promise<CameraTexture | null> {
  if (base.value?.cameras.some(({ id, isEnabled }) => id === camera.id && isEnabled)) {
    return liveTexture(camera.id, what === "frame"
      ? { what, everyMillis: FRAME_MILLIS, onChange: redraw }
      : { what, everyMillis: BACKGROUND_MILLIS, onChange: redraw });
  }
  try {
    const { picture_jpeg } = await look(camera.source);
    const bytes = Uint8Array.from(atob(picture_jpeg.replace(/^data:[^,]*,/, "")), (letter) => letter.charCodeAt(0));
    return stillTexture(new Blob([bytes], { type: "image/jpeg" }), redraw);
  } catch {
    return null;
  }
}

const keyOf = (camera: DraftCamera, what: Live) => `${camera.id} ${what} ${JSON.stringify(camera.source)}`;

/** Takes a picture into use; `release` ends that. */
function hold(key: string, camera: DraftCamera, what: Exclude<Live, "off">): Held {
  const held = pool.get(key) ?? { texture: textureOf(camera, what), users: 0 };
  if (held.users === 0) void held.texture.then(() => (came.value += 1));
  held.users += 1;
  pool.set(key, held);
  return held;
}

function release(key: string): void {
  const held = pool.get(key);
  if (!held) return;
  held.users -= 1;
  if (held.users > 0) return;
  pool.delete(key);
  void held.texture.then((texture) => texture?.dispose());
}

type Wanted = { readonly key: string; readonly camera: DraftCamera; readonly lens: Lens };

function wantedOf(of: Draft | null, what: Live): Wanted[] {
  if (!of || what === "off") return [];
  return of.cameras.flatMap((camera) => {
    const calibration = calibrationOf(of, camera.id);
    const lens = calibration && lensFor(calibration);
    return lens ? [{ key: keyOf(camera, what), camera, lens }] : [];
  });
}

/** Shows the cameras' pictures on the surfaces while that is switched on. */
export function useLive(stage: Stage | null, surfaces: Surfaces): void {
  const projection = useRef<Projection | null>(null);
  useEffect(() => {
    if (!stage) return undefined;
    const made = new Projection(surfaces);
    projection.current = made;
    stages.add(stage);
    const detach = made.attach(stage);
    return () => {
      stages.delete(stage);
      detach();
      made.dispose();
      projection.current = null;
    };
  }, [stage, surfaces]);
  const what = liveName.value;
  const wanted = wantedOf(draft.value, what);
  const keys = wanted.map(({ key }) => key).join("\n");
  useEffect(() => {
    if (what === "off") return undefined;
    const held = wantedOf(draft.peek(), what).map(({ key, camera }) => {
      hold(key, camera, what);
      return key;
    });
    return () => held.forEach(release);
  }, [keys, what]);
  const lensOfEach = wanted.map(({ lens }) => lens);
  useEffect(() => {
    let isWanted = true;
    const all = wanted.map(async ({ key, camera: { id }, lens }): Promise<Projector[]> => {
      const picture = await pool.get(key)?.texture;
      return picture ? [{ id, lens, picture }] : [];
    });
    void Promise.all(all).then((projectors) => {
      if (!isWanted) return;
      projection.current?.set(projectors.flat());
      stage?.redraw();
    });
    return () => {
      isWanted = false;
    };
  }, [keys, stage, came.value, ...lensOfEach.slice(0, 16)]);
}
