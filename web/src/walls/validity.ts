// What is wrong with a wall, told at its place while it is edited: by the daemon, which is asked as soon as typing rests and holds
// to the same rules when the wall is kept. The page itself knows of names alone, since these are no part of the document.

import { Trouble, change } from "../ask";
import { nameEnding } from "../session";
import { say } from "../strings";
import { type Wall, printWall } from "./document";

/** By JSON pointer into the wall's document. */
export type Faults = ReadonlyMap<string, string>;

const ID = /^[a-z0-9][a-z0-9_-]{0,63}$/;
/** What a new wall is tried as, whatever its name. */
const NAMELESS = "new-wall";

/** The fault of a wall's own id; `others` are taken, and a new one has the user's ending. */
export function faultOfId(id: string, others: readonly string[], ending: string): Faults {
  if (!ID.test(id)) return new Map([["/id", say("wall.fault.id")]]);
  if (!id.endsWith(ending) || id === ending) return new Map([["/id", say("wall.fault.ending", { ending })]]);
  return others.includes(id) ? new Map([["/id", say("wall.fault.taken", { id })]]) : new Map();
}

/** What the daemon says of a wall, which it does not keep; null where it cannot be asked. `id` is null of a new one. */
export async function tried(id: string | null, wall: Wall, signal: AbortSignal): Promise<Faults | null> {
  const path = `/api/v1/walls/${encodeURIComponent(id ?? NAMELESS + nameEnding())}?validate_only=true`;
  try {
    await change("PUT", path, printWall(wall), { signal });
    return new Map();
  } catch (error) {
    return error instanceof Trouble && error.faults.length > 0 ? placed(error) : null;
  }
}

/** The faults that a refusal tells, by their places. */
export function placed({ faults }: Trouble): Faults {
  return new Map(faults.map(({ pointer, parameter, detail }) => [pointer ?? parameter ?? "", detail]));
}
