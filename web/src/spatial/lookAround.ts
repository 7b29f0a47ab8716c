// Looking around by turning a phone, where there is no headset: the view's direction follows the device's back.

import type { Point, View } from "../operate/orbit";

const RAD = Math.PI / 180;
/** Without a word of its orientation for so long, the device has none to tell. */
const PATIENCE_MILLIS = 1_500;

/** Which way a device's back looks, from its angles in degrees as browsers tell them: east, north and up. */
export function facing(alpha: number, beta: number, gamma: number): Point {
  const [a, b, g] = [alpha * RAD, beta * RAD, gamma * RAD];
  // The third column of Rz(alpha) Rx(beta) Ry(gamma), turned over.
  return [
    -(Math.cos(a) * Math.sin(g) + Math.sin(a) * Math.sin(b) * Math.cos(g)),
    -(Math.sin(a) * Math.sin(g) - Math.cos(a) * Math.sin(b) * Math.cos(g)),
    -(Math.cos(b) * Math.cos(g)),
  ];
}

/** The view that looks that way, turned by `yaw` to the left. */
export function lookedAlong(view: View, [x, y, z]: Point, yaw: number): View {
  const { eye, target } = view;
  const reach = Math.hypot(target[0] - eye[0], target[1] - eye[1], target[2] - eye[2]);
  const [cosine, sine] = [Math.cos(yaw), Math.sin(yaw)];
  // Straight up and down a view has no upper edge.
  const steep = Math.min(0.999, Math.max(-0.999, z));
  const level = Math.sqrt(1 - steep * steep) / (Math.hypot(x, y) || 1);
  const [east, north] = [x * level, y * level];
  return { ...view, target: [eye[0] + (east * cosine - north * sine) * reach, eye[1] + (east * sine + north * cosine) * reach, eye[2] + steep * reach] };
}

type Asking = { requestPermission?: () => Promise<string> };

/** Follows the device until the answered function is called. Resolves to null where there is nothing to follow, or the viewer refuses.
 * To be called while the viewer presses something: browsers ask only then. */
export async function lookAround(view: () => View, onView: (view: View) => void): Promise<(() => void) | null> {
  if (!("DeviceOrientationEvent" in globalThis)) return null;
  const asking = DeviceOrientationEvent as unknown as Asking;
  if (asking.requestPermission && (await asking.requestPermission().catch(() => "denied")) !== "granted") return null;
  const ending = new AbortController();
  return new Promise((resolve) => {
    const timer = setTimeout(() => {
      ending.abort();
      resolve(null);
    }, PATIENCE_MILLIS);
    let yaw: number | null = null;
    addEventListener("deviceorientation", ({ alpha, beta, gamma }) => {
      if (alpha === null || beta === null || gamma === null) return;
      const way = facing(alpha, beta, gamma);
      if (yaw === null) {
        // Whoever begins looks the way they did: devices rarely know where north is.
        const { eye, target } = view();
        yaw = Math.atan2(target[1] - eye[1], target[0] - eye[0]) - Math.atan2(way[1], way[0]);
        clearTimeout(timer);
        resolve(() => ending.abort());
      }
      onView(lookedAlong(view(), way, yaw));
    }, { signal: ending.signal });
  });
}
