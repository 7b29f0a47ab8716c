// Rights of cameras as a matrix: a row for all cameras, one for each. What is given of all cameras is given of each.

import type { components } from "../../contract.gen";

export type Rights = components["schemas"]["Rights"];
export const RIGHTS = ["live", "history", "export", "manage"] as const;
export type Right = (typeof RIGHTS)[number];
export const ALL = "*";

/** `own` is said of this row, `all` is given with all cameras. */
export type Cell = "own" | "all" | "none";

export function cellOf(rights: Rights, camera: string, right: Right): Cell {
  if (camera !== ALL && rights[ALL]?.includes(right)) return "all";
  return rights[camera]?.includes(right) ? "own" : "none";
}

/** The rights with one given or taken; rows without any are left out. */
export function withRight(rights: Rights, camera: string, right: Right, isGiven: boolean): Rights {
  const row = RIGHTS.filter((known) => (known === right ? isGiven : rights[camera]?.includes(known)));
  const next = Object.entries({ ...rights, [camera]: row }).filter(([, own]) => own.length > 0);
  return Object.fromEntries(next);
}

/** Cameras that have a row: those there are, and those that are named though they are not there. */
export function rowsOf(rights: Rights, cameras: readonly string[]): string[] {
  const named = Object.keys(rights).filter((id) => id !== ALL && !cameras.includes(id));
  return [ALL, ...cameras, ...named];
}

/** The rights in a line. */
export function printed(rights: Rights, nameOf: (camera: string) => string): string {
  return Object.entries(rights).map(([camera, own]) => `${nameOf(camera)}: ${own.join(", ")}`).join("; ");
}
