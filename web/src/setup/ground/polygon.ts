// Outlines on the ground: made, changed corner by corner, and looked over for what a scene refuses.

import type { Corner } from "../plan/frame";

export const FEWEST_CORNERS = 3;
const MM = 1e3;

export function corner(place: readonly number[]): Corner {
  return [place[0] ?? 0, place[1] ?? 0];
}

/** To the millimetre: what a hand draws is known no better. */
export function rounded([x, y]: Corner): [number, number] {
  return [Math.round(x * MM) / MM, Math.round(y * MM) / MM];
}

/** Corners of a rectangle around a place, from the south-west on. */
export function rectangle(width: number, depth: number, [x, y]: Corner = [0, 0]): [number, number][] {
  const [w, d] = [width / 2, depth / 2];
  return ([[x - w, y - d], [x + w, y - d], [x + w, y + d], [x - w, y + d]] as const).map(rounded);
}

export function area(polygon: readonly (readonly number[])[]): number {
  const twice = polygon.reduce((sum, place, i) => {
    const [[x, y], [nextX, nextY]] = [corner(place), corner(polygon[(i + 1) % polygon.length] ?? place)];
    return sum + x * nextY - nextX * y;
  }, 0);
  return Math.abs(twice) / 2;
}

export function withCorner(polygon: readonly (readonly number[])[], idx: number, place: Corner): number[][] {
  return polygon.map((other, i) => (i === idx ? rounded(place) : [...other]));
}

/** With another corner in the middle of the edge that begins at `idx`, or at a place on it. */
export function withCornerAfter(polygon: readonly (readonly number[])[], idx: number, place?: Corner): number[][] {
  const [[x, y], [nextX, nextY]] = [corner(polygon[idx] ?? []), corner(polygon[(idx + 1) % polygon.length] ?? [])];
  const added = rounded(place ?? [(x + nextX) / 2, (y + nextY) / 2]);
  return [...polygon.slice(0, idx + 1), added, ...polygon.slice(idx + 1)].map((other) => [...other]);
}

/** Without a corner; as it was where no fewer would be left than an outline has. */
export function withoutCorner(polygon: readonly (readonly number[])[], idx: number): number[][] {
  return polygon.filter((_, i) => i !== idx || polygon.length <= FEWEST_CORNERS).map((other) => [...other]);
}

export function isInside(polygon: readonly (readonly number[])[], [x, y]: Corner): boolean {
  return polygon.reduce((isIn, place, i) => {
    const [[ax, ay], [bx, by]] = [corner(place), corner(polygon[(i + 1) % polygon.length] ?? place)];
    const isCrossed = ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax;
    return isCrossed ? !isIn : isIn;
  }, false);
}

/** On which side of the line from a to b a place lies. */
function side([ax, ay]: Corner, [bx, by]: Corner, [x, y]: Corner): number {
  return Math.sign((bx - ax) * (y - ay) - (by - ay) * (x - ax));
}

/** Whether an edge crosses another: such an outline has no inside. */
export function crosses(polygon: readonly (readonly number[])[]): boolean {
  const count = polygon.length;
  const edge = (i: number) => [corner(polygon[i] ?? []), corner(polygon[(i + 1) % count] ?? [])] as const;
  return polygon.some((_, i) => polygon.some((_other, j) => {
    if (j < i + 2 || (i === 0 && j === count - 1)) return false;
    const [[a, b], [c, d]] = [edge(i), edge(j)];
    return side(a, b, c) !== side(a, b, d) && side(c, d, a) !== side(c, d, b);
  }));
}
