// What a wall that is not kept yet would show: the scene through the windows of its tiles, as one picture where they stand in one
// plane, else a small one a tile.

import { useEffect, useMemo, useState } from "preact/hooks";
import { ask, told } from "../ask";
import { pauser } from "../pause";
import { type Wall, planeOf, windowOf } from "./document";
import { type Corners, tilesOf } from "./layout";

const AGAIN_MILLIS = 2_000;
const AFTER_TROUBLE_MILLIS = 4_000;
const AFTER_CHANGE_MILLIS = 250;
/** Longer side of the picture of a whole wall, and of one of a tile's. */
const WHOLE_PX = 960;
const TILE_PX = 192;
const LEAST_PX = 16;

/** Pictures by tile; `WHOLE` is the one of all tiles. */
export const WHOLE = "";
export type Preview = { readonly pictures: ReadonlyMap<string, string>; readonly failure: string | null; readonly time: string | null };

type Wish = { readonly key: string; readonly corners: Corners; readonly size_px: readonly [number, number] };

function sized(width: number, height: number, longer: number): readonly [number, number] {
  const scale = longer / Math.max(width, height, 1e-9);
  const side = (metres: number) => Math.max(Math.round(metres * scale), LEAST_PX);
  return [side(width), side(height)];
}

function wishes(wall: Wall): Wish[] {
  const plane = planeOf(wall.surface);
  if (plane) return [{ key: WHOLE, corners: plane.corners, size_px: sized(plane.width, plane.height, WHOLE_PX) }];
  return tilesOf(wall.surface).map(({ id, corners, size_px }) => ({ key: id, corners, size_px: sized(size_px[0], size_px[1], TILE_PX) }));
}

const printed = (points: readonly (readonly number[])[]) => points.flat().map((value) => Number(value.toFixed(5))).join(",");

/** What the daemon is asked for to see it. */
export function question(wall: Wall, { corners, size_px: [width, height] }: Omit<Wish, "key">): Record<string, string> {
  const own = Object.fromEntries(new URLSearchParams(wall.parameters));
  return {
    ...("quality" in own || "deadline_ms" in own ? {} : { quality: "draft" }),
    ...own,
    projection: "window", eye: printed([wall.eye_m]), window: printed(windowOf(wall, corners)),
    width: String(width), height: String(height), t: wall.playhead === null ? "live" : `playhead:${wall.playhead}`,
  };
}

async function picture(wall: Wall, wish: Wish, signal: AbortSignal): Promise<{ url: string; time: string | null }> {
  const response = await ask(`/api/v1/scenes/${encodeURIComponent(wall.scene)}/view.jpg`, question(wall, wish), { signal });
  const url = URL.createObjectURL(await response.blob());
  const image = new Image();
  image.src = url;
  await image.decode();
  return { url, time: response.headers.get("videofields-time") };
}

/** The wall's pictures, again and again while it is shown; `isSound` is whether it can be asked for. */
export function usePreview(wall: Wall, isSound: boolean): Preview {
  const [shown, setShown] = useState<Preview>({ pictures: new Map(), failure: null, time: null });
  // Name, rate and the like change no picture.
  const { scene, playhead, eye_m, target_m, viewer_m, zoom, parameters, surface } = wall;
  const key = JSON.stringify([scene, playhead, eye_m, target_m, viewer_m, zoom, parameters, surface]);
  const urls = useMemo(() => new Map<string, string>(), []);
  useEffect(() => () => urls.forEach((url) => URL.revokeObjectURL(url)), [urls]);
  useEffect(() => {
    if (!isSound || scene === "") return;
    const [gone, { pause, wake }] = [new AbortController(), pauser()];
    const isGone = () => gone.signal.aborted;
    const keep = (name: string, url: string) => {
      const before = urls.get(name);
      urls.set(name, url);
      // The drawing shows it a moment longer.
      if (before) setTimeout(() => URL.revokeObjectURL(before), 1_000);
    };
    const round = async () => {
      const all = wishes(wall);
      for (const old of [...urls.keys()].filter((name) => !all.some((wish) => wish.key === name))) urls.delete(old);
      for (const wish of all) {
        const { url, time } = await picture(wall, wish, gone.signal);
        keep(wish.key, url);
        if (isGone()) return;
        setShown({ pictures: new Map(urls), failure: null, time });
      }
    };
    const run = async () => {
      await pause(AFTER_CHANGE_MILLIS);
      while (!isGone()) {
        let rest = AGAIN_MILLIS;
        try {
          if (!document.hidden) await round();
        } catch (error) {
          if (isGone()) return;
          rest = AFTER_TROUBLE_MILLIS;
          setShown((before) => ({ ...before, failure: told(error) }));
        }
        await pause(rest);
      }
    };
    void run();
    return () => {
      gone.abort();
      wake();
    };
  }, [key, isSound]);
  return shown;
}
