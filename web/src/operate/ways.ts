// Flying and walking: the viewer's head turns and the viewer goes, while orbiting turns around the target. A view in, the next one
// out; metres and radians.

import { type Point, type View, axes, shiftedBy } from "./orbit";

export const MODES = ["orbit", "fly", "walk"] as const;
export type Mode = (typeof MODES)[number];

/** Eyes above what one stands on, metres. */
export const EYE_HEIGHT_M = 1.7;
/** How far ahead the target of a viewer who walks or flies lies. */
const AHEAD_M = 10;
const STEEPEST_RAD = (89 * Math.PI) / 180;

/** Metres a second; who flies is faster high above the ground. */
const WALK_SPEED = 2;
const FASTER = 3;
const FLY_SPEED = { least: 3, most: 60, perHeight: 0.6 } as const;

/** What is held down: shares of full speed to the right, ahead and upwards. */
export type Going = { right: number; ahead: number; up: number; isFast: boolean };

/** Turns the head: `yawBy` to the left, `pitchBy` upwards. The target stays as far away as it was. */
export function looked(view: View, yawBy: number, pitchBy: number): View {
  const { forward } = axes(view);
  const yaw = Math.atan2(forward[1], forward[0]) + yawBy;
  const pitch = Math.min(Math.max(Math.asin(Math.min(1, Math.max(-1, forward[2]))) + pitchBy, -STEEPEST_RAD), STEEPEST_RAD);
  return facing(view, [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)], distance(view));
}

function distance({ eye, target }: View): number {
  return Math.hypot(eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]);
}

function facing(view: View, [x, y, z]: Point, away: number): View {
  return { ...view, target: [view.eye[0] + x * away, view.eye[1] + y * away, view.eye[2] + z * away] };
}

/** Goes for so many seconds. Who walks stays level; who flies goes where they look. */
export function gone(view: View, mode: Mode, going: Going, seconds: number, groundM: number): View {
  const { forward, right } = axes(view);
  const level = Math.hypot(forward[0], forward[1]) || 1;
  const ahead: Point = mode === "walk" ? [forward[0] / level, forward[1] / level, 0] : forward;
  const by = speed(view, mode, going.isFast, groundM) * seconds;
  const along = (i: 0 | 1 | 2) => (right[i] * going.right + ahead[i] * going.ahead) * by;
  const up = mode === "walk" ? 0 : going.up * by;
  return shiftedBy(view, [along(0), along(1), along(2) + up]);
}

/** Metres a second. */
export function speed({ eye }: View, mode: Mode, isFast: boolean, groundM: number): number {
  const high = Math.abs(eye[2] - groundM) * FLY_SPEED.perHeight;
  const usual = mode === "walk" ? WALK_SPEED : Math.min(Math.max(high, FLY_SPEED.least), FLY_SPEED.most);
  return isFast ? usual * FASTER : usual;
}

/** The same direction, with the eye at a person's height above what they stand on. */
export function standing(view: View, groundM: number): View {
  return shiftedBy(view, [0, 0, groundM + EYE_HEIGHT_M - view.eye[2]]);
}

/** Takes to another way of moving: who walks comes down to the ground where they looked from above, and looks level. */
export function taken(view: View, mode: Mode, groundAt: (x: number, y: number) => number): View {
  if (mode === "orbit") return view;
  const { forward } = axes(view);
  if (mode === "fly") return facing(view, forward, AHEAD_M);
  const [x, y] = view.eye;
  const level = Math.hypot(forward[0], forward[1]) || 1;
  const down = standing(view, groundAt(x, y));
  return facing(down, [forward[0] / level, forward[1] / level, 0], AHEAD_M);
}

/** Stands there, as the viewer looks now. */
export function stoodAt(view: View, [x, y, z]: Point): View {
  const { forward } = axes(view);
  const level = Math.hypot(forward[0], forward[1]) || 1;
  return facing({ ...view, eye: [x, y, z + EYE_HEIGHT_M] }, [forward[0] / level, forward[1] / level, 0], AHEAD_M);
}
