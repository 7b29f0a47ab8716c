// Arithmetic of outlines: corners in metres, either way round, the first not repeated.

import type { Corner } from "../plan/frame";

export type Outline = readonly Corner[];

const DEGREE = Math.PI / 180;
const minus = (a: Corner, b: Corner): Corner => [a[0] - b[0], a[1] - b[1]];
const cross = (a: Corner, b: Corner) => a[0] * b[1] - a[1] * b[0];

export function corner(of: readonly number[] | undefined): Corner {
  return [of?.[0] ?? 0, of?.[1] ?? 0];
}

export function distance(a: Corner, b: Corner): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

/** A place turned about another, degrees from east towards north. */
export function turned(place: Corner, about: Corner, byDeg: number): Corner {
  const [x, y] = minus(place, about);
  const [cosine, sine] = [Math.cos(byDeg * DEGREE), Math.sin(byDeg * DEGREE)];
  return [about[0] + x * cosine - y * sine, about[1] + x * sine + y * cosine];
}

/** The edges of an outline, each from a corner to the next. */
export function edges(outline: Outline): [Corner, Corner][] {
  return outline.map((from, i) => [from, corner(outline[(i + 1) % outline.length])]);
}

/** Positive of what runs counter-clockwise. */
export function area(outline: Outline): number {
  const [first = [0, 0] as Corner] = outline;
  return edges(outline).reduce((sum, [a, b]) => sum + cross(minus(a, first), minus(b, first)), 0) / 2;
}

/** The middle of an outline's area; of its corners where it has none. */
export function middle(outline: Outline): Corner {
  const [first = [0, 0] as Corner] = outline;
  const whole = area(outline);
  if (Math.abs(whole) < 1e-9) {
    const sum = outline.reduce<Corner>((all, one) => [all[0] + one[0], all[1] + one[1]], [0, 0]);
    return [sum[0] / Math.max(outline.length, 1), sum[1] / Math.max(outline.length, 1)];
  }
  const sum = edges(outline).reduce<Corner>((all, [a, b]) => {
    const [p, q] = [minus(a, first), minus(b, first)];
    const part = cross(p, q);
    return [all[0] + (p[0] + q[0]) * part, all[1] + (p[1] + q[1]) * part];
  }, [0, 0]);
  return [first[0] + sum[0] / (6 * whole), first[1] + sum[1] / (6 * whole)];
}

export function isInside(outline: Outline, [x, y]: Corner): boolean {
  return edges(outline).reduce((inside, [[ax, ay], [bx, by]]) => {
    const isCrossed = ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax;
    return isCrossed ? !inside : inside;
  }, false);
}

/** The place of a line's stretch that is next to another, and the share of the stretch at which. */
export function nearest(place: Corner, [a, b]: readonly [Corner, Corner]): { at: Corner; share: number } {
  const [along, to] = [minus(b, a), minus(place, a)];
  const square = along[0] ** 2 + along[1] ** 2;
  const share = square === 0 ? 0 : Math.min(1, Math.max(0, (along[0] * to[0] + along[1] * to[1]) / square));
  return { at: [a[0] + along[0] * share, a[1] + along[1] * share], share };
}

/** -1 or 1 for the side of the line a b on which p lies, 0 on it. */
function side(a: Corner, b: Corner, p: Corner): number {
  return Math.sign((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]));
}

export function doCross([a, b]: readonly [Corner, Corner], [c, d]: readonly [Corner, Corner]): boolean {
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

/** The first two edges that cross, each by the corner at which it starts, as src/scene/polygon.rs has it. */
export function firstCrossing(outline: Outline): [number, number] | null {
  const all = edges(outline);
  for (const [i, one] of all.entries()) {
    const j = all.findIndex((other, at) => at > i && doCross(one, other));
    if (j >= 0) return [i, j];
  }
  return null;
}

/** The first corner that repeats the one before it; the first may repeat the last. */
export function firstRepeat(outline: Outline): number | null {
  const found = outline.findIndex((at, i) => {
    const before = corner(outline[(i + outline.length - 1) % outline.length]);
    return at[0] === before[0] && at[1] === before[1];
  });
  return found < 0 ? null : found;
}

/** The strip of a wall of some thickness along a line of two places or more: mitred where it bends, cut off where that would be long. */
export function strip(line: Outline, thickness: number): Corner[] {
  const half = thickness / 2;
  const normals = line.slice(1).map((to, i): Corner => {
    const [dx, dy] = minus(to, corner(line[i]));
    const length = Math.hypot(dx, dy) || 1;
    return [-dy / length, dx / length];
  });
  const offset = (i: number): Corner => {
    const [before, after] = [corner(normals[Math.max(i - 1, 0)]), corner(normals[Math.min(i, normals.length - 1)])];
    const sum: Corner = [before[0] + after[0], before[1] + after[1]];
    const square = sum[0] ** 2 + sum[1] ** 2;
    // At sharp bends at most four times the half thickness.
    const factor = square < 0.25 ? 2 / Math.max(Math.sqrt(square), 1e-6) / 0.5 : 2 / square;
    return [sum[0] * factor * half, sum[1] * factor * half];
  };
  const left = line.map((at, i): Corner => [at[0] + offset(i)[0], at[1] + offset(i)[1]]);
  const right = line.map((at, i): Corner => [at[0] - offset(i)[0], at[1] - offset(i)[1]]);
  return [...right, ...left.reverse()];
}
