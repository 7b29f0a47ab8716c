// Cameras that come, go and are named anew in a draft, with all that hangs on their ids.

import type { Draft, DraftCamera, Source } from "../draft";
import { idFrom } from "../ids";
import { without } from "../without";

export const KINDS = ["path", "url", "device"] as const;
export type Kind = (typeof KINDS)[number];

/** What a source is read from. */
export function kindOf(source: Source): Kind {
  return KINDS.find((kind) => kind in source) ?? "path";
}

/** What follows the last frame of a file that is newly chosen: it goes on, as a camera does. */
const FILE_END = "loop";

/** The source with another end; a loop has no last frame to be done with, and plays in real time. */
export function withEnd(source: Source, end: "loop" | "stop"): Source {
  return { ...(end === "loop" ? without(source, "pace") : source), end };
}

/** The source with another pace; one whose every frame is processed ends with the last. */
export function withPace(source: Source, pace: "real_time" | "all"): Source {
  return pace === "all" ? { ...source, end: "stop", pace } : without(source, "pace");
}

export function emptySource(kind: Kind): Source {
  return kind === "path" ? { path: "", end: FILE_END } : { [kind]: "" };
}

/** What tells a picture of the source: nothing of which part of it is played. */
export function placeOf(source: Source): Source {
  return without(source, "from_secs", "until_secs", "end", "pace", "start");
}

function follows(of: Draft, { id, name }: DraftCamera): boolean {
  return id === idFrom(name, others(of, id), "camera");
}

/** Ids that another camera must not take. */
function others(of: Draft, id: string): string[] {
  const members = of.scene.document.cameras ?? [];
  return [...of.cameras, ...members].map((camera) => camera.id).filter((other) => other !== id);
}

export function withNewCamera(of: Draft, kind: Kind): { draft: Draft; id: string } {
  const id = idFrom("", others(of, ""), "camera");
  const camera: DraftCamera = { id, name: "", source: emptySource(kind), clock: {}, isEnabled: true, origin: "new" };
  return { draft: { ...of, cameras: [...of.cameras, camera] }, id };
}

/** Gives a camera that was not kept yet another id. */
export function withId(of: Draft, from: string, to: string): Draft {
  const renamed = <Member extends { readonly id: string }>(member: Member): Member => (member.id === from ? { ...member, id: to } : member);
  const { [from]: own, ...calibrating } = of.calibrating;
  const { cameras: members, ...document } = of.scene.document;
  return {
    ...of,
    cameras: of.cameras.map(renamed),
    calibrating: own ? { ...calibrating, [to]: own } : calibrating,
    scene: members ? { ...of.scene, document: { ...document, cameras: members.map(renamed) } } : of.scene,
  };
}

/** Names a camera; the id of a new one follows the name until somebody writes it. Answers the id that it has then. */
export function withName(of: Draft, id: string, name: string, isKept: boolean): { draft: Draft; id: string } {
  const camera = of.cameras.find((one) => one.id === id);
  if (!camera) return { draft: of, id };
  const named = { ...of, cameras: of.cameras.map((one) => (one === camera ? { ...one, name } : one)) };
  if (isKept || !follows(of, camera)) return { draft: named, id };
  const next = idFrom(name, others(of, id), "camera");
  return { draft: next === id ? named : withId(named, id, next), id: next };
}

/** Takes over a stream that a camera in the network gives, with the name of the login that it wants; a camera without a name gets its
 * own. Answers the id that it has then. */
export function withStream(of: Draft, id: string, stream: { readonly url: string; readonly credentials: string; readonly name: string }, isKept: boolean): { draft: Draft; id: string } {
  const camera = of.cameras.find((one) => one.id === id);
  if (!camera) return { draft: of, id };
  // Whose login was written for another address says nothing of this one.
  const source: Source = { ...without(camera.source, "credentials", "user", "password_file", "password_env"), url: stream.url };
  const taken = { ...camera, source: stream.credentials === "" ? source : { ...source, credentials: stream.credentials } };
  const next = { ...of, cameras: of.cameras.map((one) => (one === camera ? taken : one)) };
  return camera.name === "" && stream.name !== "" ? withName(next, id, stream.name, isKept) : { draft: next, id };
}

/** Takes a camera away, with its calibration and what was clicked for it. */
export function withoutCamera(of: Draft, id: string): Draft {
  const { cameras: members, ...document } = of.scene.document;
  return {
    ...of,
    cameras: of.cameras.filter((camera) => camera.id !== id),
    calibrating: without(of.calibrating, id),
    scene: members ? { ...of.scene, document: { ...document, cameras: members.filter((member) => member.id !== id) } } : of.scene,
  };
}
