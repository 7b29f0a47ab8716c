// Who was where at a time that is over: paths as the daemon keeps them, and everybody's place at an instant.

import type { Point } from "./orbit";
import type { Sighting } from "./people";

type Stand = { readonly at: number; readonly position: Point; readonly cameras: readonly string[] };

/** Somebody, from one sighting to another without a longer break; `steps` in order of time, never empty. */
export type Path = { readonly id: string; readonly height: number; readonly steps: readonly Stand[] };

/** Where they were at an instant, straight between two steps, and who saw them; null before the first and after the last. */
export function standAt({ steps }: Path, at: number): Stand | null {
  const next = steps.findIndex((step) => step.at >= at);
  const [before, after] = next < 0 ? [undefined, undefined] : [steps[next - 1], steps[next]];
  if (!after || after.at === at || !before) return after?.at === at ? after : null;
  const share = (at - before.at) / (after.at - before.at);
  const mixed = (i: 0 | 1 | 2) => before.position[i] + (after.position[i] - before.position[i]) * share;
  return { at, position: [mixed(0), mixed(1), mixed(2)], cameras: before.cameras };
}

/** Everybody who was there at an instant. */
export function sightingsAt(paths: readonly Path[], at: number): Sighting[] {
  return paths.flatMap((path) => {
    const stand = standAt(path, at);
    return stand ? [{ id: path.id, position: stand.position, height: path.height, cameras: stand.cameras }] : [];
  });
}
