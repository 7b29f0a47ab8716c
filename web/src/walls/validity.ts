// What is wrong with a wall, told at its place while it is edited: by the daemon, which is asked as soon as typing rests and holds
// to the same rules when the wall is kept. The page itself knows of names alone, since these are no part of the document.

import { Trouble, change } from "../ask";
import { say } from "../strings";
import { type Wall, printWall } from "./document";

/** By JSON pointer into the wall's document. */
export type Faults = ReadonlyMap<string, string>;

const ID = /^[a-z0-9][a-z0-9_-]{0,63}$/;
/** What a wall without a name that can be is tried as. */
const NAMELESS = "new-wall";

/** The fault of a wall's own id; `others` are taken. */
export function faultOfId(id: string, others: readonly string[]): Faults {
  if (!ID.test(id)) return new Map([["/id", say("wall.fault.id")]]);
  return others.includes(id) ? new Map([["/id", say("wall.fault.taken", { id })]]) : new Map();
}

/** What the daemon says of a wall, which it does not keep; null where it cannot be asked. */
export async function tried(id: string, wall: Wall, signal: AbortSignal): Promise<Faults | null> {
  const path = `/api/v1/walls/${ID.test(id) ? id : NAMELESS}?validate_only=true`;
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
