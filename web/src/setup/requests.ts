// What Set-up asks of the daemon beside scenes: a look at sources, cameras that come and go, calibrations that are found, files that
// scenes name. Each throws `Trouble` with the daemon's own words, and `faults` where it named places.

import { Trouble, change, content, api } from "../ask";
import type { AxisLine, Calibration, DraftCamera, Pair, Source } from "./draft";

/** What a source shows, and what it is. */
export type Look = {
  size_px: [number, number];
  rate_hz: number | null;
  codec: string | null;
  duration_secs: number | null;
  at_secs: number | null;
  picture_jpeg: string;
};

/** One picture of a source that is not kept yet: of a file at a time, of all else the newest. */
export function look(source: Source, atSecs = 0, signal?: AbortSignal): Promise<Look> {
  return change<Look>("POST", "/api/v1/sources/look", { source, ...(source.path ? { at_secs: atSecs } : {}) }, signal ? { signal } : {});
}

export type SourceFile = { path: string; bytes: number; modified_at: string; count?: number };
export type SourceFiles = { files: SourceFile[]; is_cut: boolean; devices: { path: string }[] };

/** What could be a camera on the daemon's machine. */
export function sourceFiles(): Promise<SourceFiles> {
  return change<SourceFiles>("GET", "/api/v1/sources/files");
}

export type DeviceStream = {
  profile: string; encoding: string | null; size_px: [number, number] | null; rate_hz: number | null;
  url: string | null; reported_url: string | null;
};
export type Device = {
  services: string[]; reported_services: string[]; endpoint: string | null;
  name: string | null; maker: string | null; model: string | null;
  clock: { secs: number; error_secs: number } | null;
  streams: DeviceStream[];
  problem: string | null;
};
export type Discovery = { devices: Device[]; n_ignored: number; is_cut: boolean; credentials: string[] };

/** Cameras in the network that speak ONVIF; with an address that one alone, as whoever the credentials are. */
export function discoverCameras(whom: { address?: string; credentials?: string }): Promise<Discovery> {
  return change<Discovery>("POST", "/api/v1/sources/discover", whom);
}

export type Solved = {
  calibration: Calibration;
  rms_px: number;
  misses: { offset_px: [number, number]; distance_m: number }[];
  position_deviation_m: number;
  direction_deviation_deg: number;
  focal_deviation_px: number;
};

/** The camera that shows the places of pairs where they were clicked. */
export function solve(
  known: { image_size_px: readonly [number, number]; focal_px: number | null; finds_k1: boolean },
  pairs: readonly Pair[],
  signal?: AbortSignal,
): Promise<Solved> {
  return change<Solved>("POST", "/api/v1/calibrations/solve", { ...known, pairs }, signal ? { signal } : {});
}

export type Turned = {
  focal_px: number;
  world_from_camera: [number, number, number, number];
  rms_px: number;
  misses: { axis: string; line_idx: number; offset_px: number }[];
};

/** Direction and focal length from lines that run along the world's axes. */
export function vanishing(image_size_px: readonly [number, number], lines: readonly AxisLine[], focal_px: number | null): Promise<Turned> {
  const pencils = (["x", "y", "z"] as const)
    .map((axis) => ({ axis, lines: lines.filter((line) => line.axis === axis).map(({ ends_px }) => ends_px) }))
    .filter(({ lines }) => lines.length > 0);
  return change<Turned>("POST", "/api/v1/calibrations/vanishing", { image_size_px, pencils, focal_px });
}

export type ImportOptions = { format?: string; entry?: string; image_size_px?: string; metres_per_unit?: number };

/** Reads a calibration in any format that the daemon knows, without keeping it. */
export function importCalibration(text: string, options: ImportOptions): Promise<{ calibration: Calibration; residual_px: number | null }> {
  const query = new URLSearchParams(Object.entries(options).map(([name, value]) => [name, String(value)])).toString();
  return change("POST", `/api/v1/calibrations/import${query ? `?${query}` : ""}`, text, { type: "text/plain" });
}

/** Keeps a camera: a new one without a tag, else the one of that tag. Answers the tag that it has now. */
export async function putCamera({ id, name, source, clock, isEnabled, segment }: DraftCamera, tag: string | null): Promise<string | null> {
  const path = `/api/v1/cameras/${encodeURIComponent(id)}`;
  const body = { name, source, clock, enabled: isEnabled, ...(segment ? { segment } : {}) };
  return (await change<Response>("PUT", path, body, { tag, raw: true })).headers.get("ETag");
}

/** A camera that was made here, with its tag; null of one that the configuration has. */
export async function cameraDocument(id: string): Promise<{ camera: DraftCamera; tag: string } | null> {
  try {
    const answer = await change<Response>("GET", `/api/v1/cameras/${encodeURIComponent(id)}/document`, undefined, { raw: true });
    const read = (await answer.json()) as { name?: string; source: Source; clock?: DraftCamera["clock"]; enabled?: boolean; segment?: DraftCamera["segment"] };
    const { name = "", source, clock = {}, enabled: isEnabled = true, segment } = read;
    const camera = { id, name, source, clock, isEnabled, ...(segment ? { segment } : {}), origin: "kept" as const };
    return { camera, tag: answer.headers.get("ETag") ?? "" };
  } catch (error) {
    if (error instanceof Trouble && error.status === 404) return null;
    throw error;
  }
}

export async function removeCamera(id: string, tag: string): Promise<void> {
  await change("DELETE", `/api/v1/cameras/${encodeURIComponent(id)}`, undefined, { tag });
}

/** Files are large, and lines may be slow. */
const FILE_MILLIS = 600_000;

/** Keeps a picture or model that scenes name as `assets/NAME`. */
export async function putAsset(name: string, file: Blob): Promise<void> {
  await change("PUT", `/api/v1/assets/${encodeURIComponent(name)}`, file, { tag: null, type: file.type || "application/octet-stream", patienceMillis: FILE_MILLIS });
}

/** A scene's document with its tag; null where there is none. */
export async function sceneDocument(id: string) {
  const { data, response } = await api.GET("/api/v1/scenes/{id}", { params: { path: { id } } });
  if (response.status === 404) return null;
  return { document: await content(Promise.resolve({ ...(data ? { data } : {}), response })), tag: response.headers.get("ETag") };
}
