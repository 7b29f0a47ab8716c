// A camera in the hand: what moving, turning and zooming make of its calibration.

import type { Point } from "../../operate/orbit";
import type { Calibration } from "../draft";
import { type Angles, add, aim, angles, direction, focal, fov, lookingAt, point, quaternion } from "./torch";

export const FOV_DEG = [1, 150] as const;

const clamp = (value: number, [low, high]: readonly [number, number]) => Math.min(Math.max(value, low), high);

/** Degrees across the picture. */
export const fovOf = ({ focal_px: [f = 1], image_size_px: [width = 1] }: Calibration) => fov(f, width);

export function withFov(of: Calibration, degrees: number): Calibration {
  const [fx = 1, fy = 1] = of.focal_px;
  const next = focal(clamp(degrees, FOV_DEG), of.image_size_px[0] ?? 1);
  return { ...of, focal_px: [next, (next * fy) / fx] };
}

export const anglesOf = (of: Calibration): Angles => angles(quaternion(of.world_from_camera));

/** Turned on the spot. */
export function withAngles(of: Calibration, change: Partial<Angles>): Calibration {
  const next = { ...anglesOf(of), ...change };
  return { ...of, world_from_camera: [...direction({ ...next, tilt_deg: clamp(next.tilt_deg, [-90, 90]) })] };
}

/** Moved, and looking into the same direction as before. */
export const standingAt = (of: Calibration, place: Point): Calibration => ({ ...of, position_m: [...place] });

export function movedBy(of: Calibration, by: Point): Calibration {
  return standingAt(of, add(point(of.position_m), by));
}

/** Moved, and still pointing at the same place of a level, as whoever carries a torch does. */
export function carriedTo(of: Calibration, place: Point, level_m: number): Calibration {
  return pointedAt(standingAt(of, place), aim(of, level_m));
}

/** Turned on the spot so that it points at a place, rolled as before. */
export function pointedAt(of: Calibration, place: Point): Calibration {
  const before = quaternion(of.world_from_camera);
  return { ...of, world_from_camera: [...lookingAt(point(of.position_m), place, angles(before).roll_deg, before)] };
}

const TURN_DEG = [0.25, 2] as const;
const STEP_M = [0.1, 1] as const;
const ZOOM = [1.01, 1.08] as const;

/** What a key makes of a camera in the hand; null where it means nothing. Shift makes larger steps. */
export function keyed(of: Calibration, key: string, isShift: boolean): Calibration | null {
  const i = isShift ? 1 : 0;
  const { heading_deg, tilt_deg, roll_deg } = anglesOf(of);
  const toward = (right: number, ahead: number): Calibration => {
    const [sine, cosine] = [Math.sin((heading_deg * Math.PI) / 180), Math.cos((heading_deg * Math.PI) / 180)];
    return movedBy(of, [(right * cosine + ahead * sine) * STEP_M[i], (ahead * cosine - right * sine) * STEP_M[i], 0]);
  };
  switch (key.length === 1 ? key.toLowerCase() : key) {
    case "ArrowLeft": return withAngles(of, { heading_deg: heading_deg - TURN_DEG[i] });
    case "ArrowRight": return withAngles(of, { heading_deg: heading_deg + TURN_DEG[i] });
    case "ArrowUp": return withAngles(of, { tilt_deg: tilt_deg - TURN_DEG[i] });
    case "ArrowDown": return withAngles(of, { tilt_deg: tilt_deg + TURN_DEG[i] });
    case "q": return withAngles(of, { roll_deg: roll_deg - TURN_DEG[i] });
    case "e": return withAngles(of, { roll_deg: roll_deg + TURN_DEG[i] });
    case "w": return toward(0, 1);
    case "s": return toward(0, -1);
    case "a": return toward(-1, 0);
    case "d": return toward(1, 0);
    case "PageUp": return movedBy(of, [0, 0, STEP_M[i]]);
    case "PageDown": return movedBy(of, [0, 0, -STEP_M[i]]);
    case "z": return withFov(of, fovOf(of) / ZOOM[i]);
    case "x": return withFov(of, fovOf(of) * ZOOM[i]);
    default: return null;
  }
}
