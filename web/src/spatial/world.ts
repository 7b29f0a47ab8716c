// The world's axes (right-handed, metres, z up) and three.js's (y up), converted here and nowhere else. What is drawn hangs, in
// world axes, beneath a root that turns it; three.js's own cameras, and headsets, stand in three.js's axes.

import { Group, Matrix4, Vector3 } from "three";
import type { Point } from "../operate/orbit";

/** Takes a place in the world to three.js's axes: x stays, z becomes y, -y becomes z. */
export function toThree([x, y, z]: Point, into = new Vector3()): Vector3 {
  return into.set(x, z, -y);
}

/** The way back. */
export function fromThree({ x, y, z }: { x: number; y: number; z: number }): Point {
  return [x, -z, y];
}

/** `three_from_world` as a matrix; an anchor, in the world, lies at three.js's origin so that far places keep their digits. */
export function threeFromWorld([ax, ay, az]: Point = [0, 0, 0]): Matrix4 {
  return new Matrix4().set(1, 0, 0, -ax, 0, 0, 1, -az, 0, -1, 0, ay, 0, 0, 0, 1);
}

/** A group whose children stand in world axes, relative to `anchor`. */
export function worldRoot(): Group {
  const root = new Group();
  root.name = "world";
  root.matrixAutoUpdate = false;
  root.matrix.copy(threeFromWorld());
  root.matrixWorldNeedsUpdate = true;
  return root;
}
