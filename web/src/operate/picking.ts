// Who stands where in the picture.

import { type View, placed } from "./orbit";
import type { Person } from "./people";

/** Arms and packs reach beside: shares of somebody's height. */
const BESIDE = 0.3;
/** However far away somebody is, they can be met: share of the picture's height. */
const LEAST = 0.02;

/** The one whose figure covers a place of the picture, shares of width and height; the nearest to the viewer of several. */
export function personAt(people: Iterable<Person>, view: View, aspect: number, [x, y]: readonly [number, number]): Person | null {
  let found: Person | null = null;
  let least = Infinity;
  for (const person of people) {
    const [px, py, pz] = person.position;
    const [foot, head] = [placed(view, aspect, [px, py, pz]), placed(view, aspect, [px, py, pz + person.height])];
    if (person.isLost || !foot || !head) continue;
    const tall = Math.max(foot[1] - head[1], LEAST);
    const isOver = Math.abs(x - (foot[0] + head[0]) / 2) * aspect <= Math.max(tall * BESIDE, LEAST) && y >= head[1] - LEAST && y <= foot[1] + LEAST;
    const away = Math.hypot(px - view.eye[0], py - view.eye[1]);
    if (isOver && away < least) [found, least] = [person, away];
  }
  return found;
}
