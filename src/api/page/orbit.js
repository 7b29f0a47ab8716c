// The viewer's movements as plain functions: a view { eye, target, fov } in, the next one out. World metres with z
// up, `fov` in vertical degrees; `aspect` is width over height.

const STEEPEST_RAD = (89 * Math.PI) / 180;
const DISTANCE_M = [0.05, 1e6];

const add = (a, b, scale = 1) => a.map((value, i) => value + b[i] * scale);
const minus = (a, b) => add(a, b, -1);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const clamp = (value, [low, high]) => Math.min(Math.max(value, low), high);

function polar({ eye, target }) {
  const [x, y, z] = minus(eye, target);
  const distance = Math.hypot(x, y, z);
  return { yaw: Math.atan2(y, x), pitch: Math.asin(clamp(z / distance, [-1, 1])), distance };
}

function eyeAt(target, { yaw, pitch, distance }) {
  const level = Math.cos(pitch) * distance;
  return add(target, [Math.cos(yaw) * level, Math.sin(yaw) * level, Math.sin(pitch) * distance]);
}

/** Turns the viewer around the target, radians. */
export function turned(view, yawBy, pitchBy) {
  const at = polar(view);
  at.yaw += yawBy;
  at.pitch = clamp(at.pitch + pitchBy, [-STEEPEST_RAD, STEEPEST_RAD]);
  return { ...view, eye: eyeAt(view.target, at) };
}

/** Brings the viewer to `factor` times its distance. */
export function nearer(view, factor) {
  const at = polar(view);
  at.distance = clamp(at.distance * factor, DISTANCE_M);
  return { ...view, eye: eyeAt(view.target, at) };
}

/** Moves eye and target level with the ground by shares of the picture's height, to the right and away. */
export function moved(view, right, away) {
  const { yaw, distance } = polar(view);
  const height = 2 * distance * Math.tan((view.fov * Math.PI) / 360);
  const step = [
    (-Math.sin(yaw) * right - Math.cos(yaw) * away) * height,
    (Math.cos(yaw) * right - Math.sin(yaw) * away) * height,
    0,
  ];
  return { ...view, eye: add(view.eye, step), target: add(view.target, step) };
}

/** Where a world point stands in the picture, shares of width and height from the top left; null outside it. */
export function placed(view, aspect, point) {
  const { yaw, pitch } = polar(view);
  const forward = [-Math.cos(yaw) * Math.cos(pitch), -Math.sin(yaw) * Math.cos(pitch), -Math.sin(pitch)];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  const up = [-Math.cos(yaw) * Math.sin(pitch), -Math.sin(yaw) * Math.sin(pitch), Math.cos(pitch)];
  const offset = minus(point, view.eye);
  const depth = dot(offset, forward);
  if (depth <= 0) return null;
  const half = depth * Math.tan((view.fov * Math.PI) / 360);
  const place = [0.5 + dot(offset, right) / (2 * half * aspect), 0.5 - dot(offset, up) / (2 * half)];
  return place.every((share) => share >= 0 && share <= 1) ? place : null;
}
