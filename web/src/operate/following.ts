// Keeps whom the viewer follows in the middle of the view, smoothly, whoever sees them.

import { effect } from "@preact/signals";
import { type Point, type View, nearer, shiftedBy } from "./orbit";
import * as state from "./state";
import { followedPerson } from "./tracking";

/** In this time most of the way to them is gone. */
const EASE_MILLIS = 350;
/** What is looked at: about their middle. */
const MIDDLE_M = 0.9;
const STILL_M = 0.04;
/** Who follows from farther away comes closer, once. */
const CLOSE_M = 16;

const distance = ({ eye, target }: View) => Math.hypot(eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]);

/** The view a little nearer to having `person` in its middle. Null where it has. */
export function eased(view: View, [x, y, z]: Point, mode: string, millis: number): View | null {
  const by: Point = [x - view.target[0], y - view.target[1], z + MIDDLE_M - view.target[2]];
  if (Math.hypot(...by) < STILL_M) return null;
  const share = 1 - Math.exp(-millis / EASE_MILLIS);
  const part: Point = [by[0] * share, by[1] * share, by[2] * share];
  // Who walks stays where they are and turns the head.
  if (mode === "walk") return { ...view, target: [view.target[0] + part[0], view.target[1] + part[1], view.target[2] + part[2]] };
  return shiftedBy(view, part);
}

/** Follows until the answered function is called. */
export function attend(): () => void {
  let frame = 0;
  let isComing = false;
  const stop = effect(() => {
    const id = state.followed.value;
    cancelAnimationFrame(frame);
    if (id === undefined) return;
    isComing = true;
    let before = performance.now();
    const step = (now: number) => {
      frame = requestAnimationFrame(step);
      const [view, person] = [state.view.peek(), followedPerson.peek()];
      const millis = Math.min(now - before, 200);
      before = now;
      if (!view || !person || person.isLost || state.openedCamera.peek() !== undefined) return;
      let next = eased(view, person.position, state.mode.peek(), millis);
      if (isComing && state.mode.peek() === "orbit") {
        const away = distance(next ?? view);
        isComing = away > CLOSE_M * 1.02;
        if (isComing) next = nearer(next ?? view, Math.max(CLOSE_M / away, Math.exp(-millis / EASE_MILLIS)));
      }
      if (next) state.setView(next);
    };
    frame = requestAnimationFrame(step);
  });
  return () => {
    stop();
    cancelAnimationFrame(frame);
  };
}
