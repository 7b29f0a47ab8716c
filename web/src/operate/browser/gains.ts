// What the cameras' colours are evened out by, as the daemon has worked it out of what they see of the same places.

import { api, content } from "../../ask";
import type { Point } from "../orbit";

/** By camera: red, green and blue, in linear light. */
export type Gains = ReadonlyMap<string, Point>;
export const NO_GAINS: Gains = new Map();

/** They follow the light, which changes slowly. */
const AGAIN_MILLIS = 5_000;

/** Tells a scene's gains again and again, until `signal` ends it. What cannot be learnt stays as it was. */
export async function followGains(scene: string, tell: (gains: Gains) => void, signal: AbortSignal): Promise<void> {
  const query = { entities: "none", colors: "even", quality: "draft", width: 16, height: 16 } as const;
  while (!signal.aborted) {
    try {
      const { gains } = await content(api.GET("/api/v1/scenes/{id}/plan", { params: { path: { id: scene }, query }, signal }));
      tell(new Map(gains.map(({ camera, gain: [red = 1, green = 1, blue = 1] }) => [camera, [red, green, blue] as const])));
    } catch {
      // The next round tries again, unless it was ended.
    }
    await new Promise<void>((resolve) => {
      const timer = setTimeout(resolve, AGAIN_MILLIS);
      signal.addEventListener("abort", () => {
        clearTimeout(timer);
        resolve();
      }, { once: true });
    });
  }
}
