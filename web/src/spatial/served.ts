// Files that scenes name, as bytes: from whoever has one that the daemon has not got yet (Set-up, before it saves), else the daemon's.

import { ask } from "../ask";

type Holder = (file: string) => Promise<Blob | null>;

let holder: Holder = () => Promise.resolve(null);

/** From now on files are looked for here first, by what scenes name them. */
export function lookFirst(next: Holder): void {
  holder = next;
}

/** The file behind an address such as `/api/v1/assets/NAME`. Throws `Trouble`. */
export async function served(path: string, signal: AbortSignal): Promise<Blob> {
  const name = decodeURIComponent(path.slice(path.lastIndexOf("/") + 1));
  return (await holder(`assets/${name}`)) ?? (await ask(path, {}, { signal })).blob();
}
