// The viewer's movements as plain functions: a view in, the next one out. World metres with z up, `fov` in vertical degrees;
// `aspect` is width over height.

export type Point = readonly [number, number, number];
export type View = { readonly eye: Point; readonly target: Point; readonly fov: number };
type Polar = { yaw: number; pitch: number; distance: number };

const STEEPEST_RAD = (89 * Math.PI) / 180;
const DISTANCE_M = [0.05, 1e6] as const;

const add = (a: Point, b: Point): Point => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const clamp = (value: number, [low, high]: readonly [number, number]) => Math.min(Math.max(value, low), high);

function polar({ eye, target }: View): Polar {
  const [x, y, z] = minus(eye, target);
  const distance = Math.hypot(x, y, z);
  return { yaw: Math.atan2(y, x), pitch: Math.asin(clamp(z / distance, [-1, 1])), distance };
}

function eyeAt(target: Point, { yaw, pitch, distance }: Polar): Point {
  const level = Math.cos(pitch) * distance;
  return add(target, [Math.cos(yaw) * level, Math.sin(yaw) * level, Math.sin(pitch) * distance]);
}

/** Turns the viewer around the target, radians. */
export function turned(view: View, yawBy: number, pitchBy: number): View {
  const at = polar(view);
  const pitch = clamp(at.pitch + pitchBy, [-STEEPEST_RAD, STEEPEST_RAD]);
  return { ...view, eye: eyeAt(view.target, { ...at, yaw: at.yaw + yawBy, pitch }) };
}

/** Brings the viewer to `factor` times its distance. */
export function nearer(view: View, factor: number): View {
  const at = polar(view);
  return { ...view, eye: eyeAt(view.target, { ...at, distance: clamp(at.distance * factor, DISTANCE_M) }) };
}

/** Moves eye and target level with the ground by shares of the picture's height, to the right and away. */
export function moved(view: View, right: number, away: number): View {
  const { yaw, distance } = polar(view);
  const height = 2 * distance * Math.tan((view.fov * Math.PI) / 360);
  const step: Point = [
    (-Math.sin(yaw) * right - Math.cos(yaw) * away) * height,
    (Math.cos(yaw) * right - Math.sin(yaw) * away) * height,
    0,
  ];
  return { ...view, eye: add(view.eye, step), target: add(view.target, step) };
}

/** Where a world point stands in the picture, shares of width and height from the top left; null outside it. */
export function placed(view: View, aspect: number, point: Point): [number, number] | null {
  const { forward, right, up } = axes(view);
  const offset = minus(point, view.eye);
  const depth = dot(offset, forward);
  if (depth <= 0) return null;
  const half = depth * Math.tan((view.fov * Math.PI) / 360);
  const x = 0.5 + dot(offset, right) / (2 * half * aspect);
  const y = 0.5 - dot(offset, up) / (2 * half);
  return x >= 0 && x <= 1 && y >= 0 && y <= 1 ? [x, y] : null;
}

const rounded = (metres: number) => String(Number(metres.toFixed(4)));

/** A view as the interface's parameters and this page's address have it. */
export function printed(view: View): { eye: string; target: string; fov: string } {
  return { eye: view.eye.map(rounded).join(","), target: view.target.map(rounded).join(","), fov: String(view.fov) };
}

/** Three numbers with commas between them. */
export function point(text: string | undefined): Point | null {
  const numbers = (text ?? "").split(",").map(Number);
  const [x, y, z] = numbers;
  if (numbers.length !== 3 || x === undefined || y === undefined || z === undefined) return null;
  return numbers.every(Number.isFinite) ? [x, y, z] : null;
}

/** The view of such parameters, if they make one. */
export function read(parts: Readonly<Record<string, string>>): View | null {
  const [eye, target, fov] = [point(parts["eye"]), point(parts["target"]), Number(parts["fov"])];
  if (!eye || !target || !(fov >= 1 && fov <= 170)) return null;
  return Math.hypot(...minus(eye, target)) > 1e-6 ? { eye, target, fov } : null;
}

/** The view that the field `Videofields-View` tells. */
export function readField(text: string | null): View | null {
  const parts = (text ?? "").split(";").map((part) => part.split("=", 2));
  return read(Object.fromEntries(parts.filter((part): part is [string, string] => part.length === 2)));
}

/** How the viewer looks: ahead, to the right and upwards, each of length 1. */
export function axes(view: View): { forward: Point; right: Point; up: Point } {
  const { yaw, pitch } = polar(view);
  return {
    forward: [-Math.cos(yaw) * Math.cos(pitch), -Math.sin(yaw) * Math.cos(pitch), -Math.sin(pitch)],
    right: [-Math.sin(yaw), Math.cos(yaw), 0],
    up: [-Math.cos(yaw) * Math.sin(pitch), -Math.sin(yaw) * Math.sin(pitch), Math.cos(pitch)],
  };
}

/** The direction, of length 1, in which a place of the picture lies: shares of width and height from the top left. */
export function toward(view: View, aspect: number, [x, y]: readonly [number, number]): Point {
  const { forward, right, up } = axes(view);
  const half = Math.tan((view.fov * Math.PI) / 360);
  const [across, above] = [(2 * x - 1) * half * aspect, (1 - 2 * y) * half];
  const along = [0, 1, 2].map((i) => (forward[i] ?? 0) + (right[i] ?? 0) * across + (up[i] ?? 0) * above);
  const length = Math.hypot(...along);
  return [(along[0] ?? 0) / length, (along[1] ?? 0) / length, (along[2] ?? 0) / length];
}

/** Eye and target moved by the same way. */
export function shiftedBy(view: View, by: Point): View {
  return { ...view, eye: add(view.eye, by), target: add(view.target, by) };
}

/** The way from one view to another, `share` of it: eye, direction and angle change evenly. */
export function between(from: View, to: View, share: number): View {
  const mixed = (a: number, b: number) => a + (b - a) * share;
  const mix = (a: Point, b: Point): Point => [mixed(a[0], b[0]), mixed(a[1], b[1]), mixed(a[2], b[2])];
  const next = { eye: mix(from.eye, to.eye), target: mix(from.target, to.target), fov: mixed(from.fov, to.fov) };
  return Math.hypot(...minus(next.eye, next.target)) > 1e-3 ? next : to;
}
