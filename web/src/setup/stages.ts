// How far the four stages are, and what is missing of each.

import { calibrationOf, type Draft } from "./draft";
import type { Stage } from "./faults";

export type Progress = {
  readonly state: "empty" | "begun" | "done";
  /** What is missing, by the keys of the texts; none where nothing is. */
  readonly missing: readonly Missing[];
};
export type Missing =
  | "videos" | "sources" | "ground" | "calibrations" | "calibrations.some" | "geometry";

/** Whether a camera names where its pictures come from. */
export function hasPlace({ source }: Draft["cameras"][number]): boolean {
  return Boolean(source.path ?? source.url ?? source.device);
}

function videos({ cameras }: Draft): Progress {
  if (cameras.length === 0) return { state: "empty", missing: ["videos"] };
  // Of a configured camera the page may not know the source.
  const isWhole = cameras.every((camera) => camera.origin === "configured" || hasPlace(camera));
  return isWhole ? { state: "done", missing: [] } : { state: "begun", missing: ["sources"] };
}

function ground({ scene: { document } }: Draft): Progress {
  const count = (document.ground?.length ?? 0) + (document.height_fields?.length ?? 0);
  if (count > 0) return { state: "done", missing: [] };
  return { state: document.origin ? "begun" : "empty", missing: ["ground"] };
}

function cameras(draft: Draft): Progress {
  const members = draft.scene.document.cameras ?? [];
  const isCalibrated = (id: string) => calibrationOf(draft, id) !== null || members.some((member) => member.id === id);
  const bare = draft.cameras.filter(({ id, isEnabled }) => isEnabled && !isCalibrated(id));
  const n = draft.cameras.length - bare.length;
  if (n > 0 && bare.length === 0) return { state: "done", missing: [] };
  const isBegun = n > 0 || Object.values(draft.calibrating).some(({ pairs, lines }) => pairs.length + lines.length > 0);
  return { state: isBegun ? "begun" : "empty", missing: [n > 0 ? "calibrations.some" : "calibrations"] };
}

function geometry({ scene: { document } }: Draft): Progress {
  const lists = [document.boxes, document.cylinders, document.footprints, document.models];
  return lists.some((list) => (list?.length ?? 0) > 0) ? { state: "done", missing: [] } : { state: "empty", missing: ["geometry"] };
}

const OF: Record<Stage, (draft: Draft) => Progress> = { videos, ground, cameras, geometry };

export function progress(draft: Draft, stage: Stage): Progress {
  return OF[stage](draft);
}
