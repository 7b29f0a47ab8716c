// Settings from fast to exact: what each is expected to take and to leave of error, by the daemon's own plan.

import { Trouble, api, content } from "../../ask";

/** Parameters of views that say how exactly one is drawn. */
export type Parameters = Readonly<Record<string, string>>;
export type Setting = {
  readonly key: string;
  readonly parameters: Parameters;
  readonly millis: number | null;
  readonly upperMillis: number | null;
  readonly error: number | null;
  readonly basis: string;
  readonly knobs: Readonly<Record<string, unknown>>;
};

/** From the roughest to the most exact; `system.setting.*` has their names. */
const SETTINGS: Readonly<Record<string, Parameters>> = {
  rough: { quality: "draft", resolution: "quarter", filtering: "nearest", depth_maps: "off" },
  quarter: { quality: "draft", resolution: "quarter" },
  draft: { quality: "draft" },
  smooth: { quality: "draft", resolution: "whole" },
  single: { quality: "balanced", samples: "1" },
  balanced: { quality: "balanced" },
  exact: { quality: "exact" },
};

export const EXACT: Parameters = { quality: "exact" };
export const SIZE = { width: 640, height: 360 } as const;

/** The view that is looked at: its scene, and the parameters that say from where. */
export type Looked = { readonly scene: string; readonly view: Parameters };

export async function planned(key: string, parameters: Parameters, { scene, view }: Looked): Promise<Setting> {
  // Words and numbers as the address of a view has them.
  const query: object = { ...view, ...parameters, ...SIZE };
  const plan = await content(api.GET("/api/v1/scenes/{id}/plan", { params: { path: { id: scene }, query } }));
  return {
    key, parameters, millis: plan.expected_ms, upperMillis: plan.expected_upper_ms, error: plan.expected_error, basis: plan.expected_by ?? "guess", knobs: plan.settings,
  };
}

/** All settings for a view, the fastest first; those that this view cannot be drawn with are left out. */
export async function settings(looked: Looked): Promise<Setting[]> {
  const found: Setting[] = [];
  for (const [key, parameters] of Object.entries(SETTINGS)) {
    try {
      found.push(await planned(key, parameters, looked));
    } catch (error) {
      if (!(error instanceof Trouble) || error.status !== 422) throw error;
    }
  }
  return found;
}
