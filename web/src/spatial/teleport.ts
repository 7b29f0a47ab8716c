// How somebody with a headset gets about: by pointing at a place and being there, and by turning in steps. Plain functions, in
// three.js's axes (y up), with the play space as a rig that stands somewhere, turned about the vertical.

/** Where the play space stands, and its turn to the left, radians. */
export type Rig = { readonly x: number; readonly y: number; readonly z: number; readonly yaw: number };
export type Place = { readonly x: number; readonly y: number; readonly z: number };

/** A step of turning. */
export const SNAP_RAD = Math.PI / 6;
/** A stick that is pushed so far turns, and must come back so far before it turns again. */
const PUSHED = 0.7;
const BACK = 0.3;
/** Steeper is a wall: nobody is put onto it. */
const LEAST_LEVEL = Math.SQRT1_2;
const FARTHEST_M = 60;

/** Stands on `target` with the head over it. `head` is where it is now. */
export function teleported(rig: Rig, head: Place, target: Place): Rig {
  return { ...rig, x: rig.x + target.x - head.x, y: target.y, z: rig.z + target.z - head.z };
}

/** Turns by `yawBy` to the left around the head, which stays where it is. */
export function turnedAround(rig: Rig, head: Place, yawBy: number): Rig {
  const [cosine, sine] = [Math.cos(yawBy), Math.sin(yawBy)];
  const [x, z] = [rig.x - head.x, rig.z - head.z];
  return { ...rig, x: head.x + x * cosine + z * sine, z: head.z - x * sine + z * cosine, yaw: rig.yaw + yawBy };
}

/** What a stick's push to the right (-1 to 1) does: the turn to the left that it makes, and whether it is held from now on. */
export function snapped(isHeld: boolean, push: number): { turn: number; isHeld: boolean } {
  if (isHeld) return { turn: 0, isHeld: Math.abs(push) > BACK };
  if (Math.abs(push) < PUSHED) return { turn: 0, isHeld: false };
  return { turn: -Math.sign(push) * SNAP_RAD, isHeld: true };
}

/** Whether one can be put where a ray met something: `up` is how much its surface faces upwards. */
export function isLanding(up: number, distance: number): boolean {
  return up >= LEAST_LEVEL && distance <= FARTHEST_M;
}
