import { expect, test } from "vitest";
import { SNAP_RAD, type Place, type Rig, isLanding, snapped, teleported, turnedAround } from "./teleport";

const rig: Rig = { x: 1, y: 0, z: 2, yaw: 0 };
/** Where somebody who stands at `offset` in their room is in the scene. */
const headOf = ({ x, y, z, yaw }: Rig, offset: Place): Place => ({
  x: x + offset.x * Math.cos(yaw) + offset.z * Math.sin(yaw),
  y: y + offset.y,
  z: z - offset.x * Math.sin(yaw) + offset.z * Math.cos(yaw),
});
const offset = { x: 0.5, y: 1.6, z: -0.3 };

test("the head comes to stand over the place that was pointed at", () => {
  const target = { x: 10, y: 2.5, z: -4 };
  const head = headOf(teleported(rig, headOf(rig, offset), target), offset);
  expect(head.x).toBeCloseTo(10);
  expect(head.z).toBeCloseTo(-4);
  expect(head.y).toBeCloseTo(2.5 + 1.6);
});

test("turning leaves the head where it is", () => {
  const before = headOf(rig, offset);
  const next = turnedAround(rig, before, SNAP_RAD);
  const after = headOf(next, offset);
  expect(after.x).toBeCloseTo(before.x);
  expect(after.z).toBeCloseTo(before.z);
  expect(next.yaw).toBeCloseTo(SNAP_RAD);
  const whole = Array.from({ length: 12 }).reduce<Rig>((at) => turnedAround(at, headOf(at, offset), SNAP_RAD), rig);
  expect(whole.x).toBeCloseTo(rig.x);
  expect(whole.z).toBeCloseTo(rig.z);
});

test("a stick turns once a push", () => {
  expect(snapped(false, 0.5)).toEqual({ turn: 0, isHeld: false });
  expect(snapped(false, 0.9)).toEqual({ turn: -SNAP_RAD, isHeld: true });
  expect(snapped(true, 0.9)).toEqual({ turn: 0, isHeld: true });
  expect(snapped(true, 0.2)).toEqual({ turn: 0, isHeld: false });
  expect(snapped(false, -0.8).turn).toBeCloseTo(SNAP_RAD);
});

test("nobody lands on a wall, or out of sight", () => {
  expect(isLanding(1, 5)).toBe(true);
  expect(isLanding(0.2, 5)).toBe(false);
  expect(isLanding(1, 500)).toBe(false);
});
