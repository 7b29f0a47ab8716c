// Where a picture lies on the ground: by control points, which known lengths, a north arrow and a hand move all together.

import type { components } from "../../contract.gen";
import type { PlaneMap } from "../../spatial/planeMap";
import { textureAt } from "../../spatial/planeMap";
import type { Corner } from "../plan/frame";

export type Imagery = components["schemas"]["Imagery"];
type Point = NonNullable<Imagery["control_points"]>[number];

/** A picture is placed to a tenth of a millimetre. */
const DIGITS = 1e4;
const DEG = Math.PI / 180;

/** What keeps shapes: world' = centre + factor * turn * (world - centre) + shift. */
export type Move = {
  readonly about: Corner;
  readonly factor?: number;
  /** From east towards north, degrees. */
  readonly turnDeg?: number;
  readonly shift?: Corner;
};

export function moved([x, y]: Corner, { about, factor = 1, turnDeg = 0, shift = [0, 0] }: Move): Corner {
  const [sine, cosine] = [Math.sin(turnDeg * DEG), Math.cos(turnDeg * DEG)];
  const [dx, dy] = [x - about[0], y - about[1]];
  return [
    about[0] + factor * (cosine * dx - sine * dy) + shift[0],
    about[1] + factor * (sine * dx + cosine * dy) + shift[1],
  ];
}

/** The picture scaled, turned or shifted as a whole. */
export function movedImagery(imagery: Imagery, move: Move): Imagery {
  const round = (n: number) => Math.round(n * DIGITS) / DIGITS;
  const control_points = (imagery.control_points ?? []).map(({ pixel, world }): Point => ({
    pixel, world: moved([world[0] ?? 0, world[1] ?? 0], move).map(round),
  }));
  return { ...imagery, control_points };
}

/** A picture whose upper edge is north, so many metres a pixel, with its middle at a place: all four corners are its points. */
export function laidOut(file: string, [width, height]: Corner, metresPerPixel: number, [x, y]: Corner): Imagery {
  const corners: Corner[] = [[0, 0], [width, 0], [width, height], [0, height]];
  const control_points = corners.map(([px, py]): Point => ({
    pixel: [px, py],
    world: [x + (px - width / 2) * metresPerPixel, y - (py - height / 2) * metresPerPixel],
  }));
  return { file, control_points, transform: "affine" };
}

/** By how much a picture is scaled so that the line between two of its places is as long as it really is; its first end stays. */
export function byLength(from: Corner, to: Corner, metres: number): Move | null {
  const drawn = Math.hypot(to[0] - from[0], to[1] - from[1]);
  return drawn > 0 && metres > 0 ? { about: from, factor: metres / drawn } : null;
}

/** By how much a picture is turned so that an arrow on it points north; its tail stays. */
export function byNorth(from: Corner, to: Corner): Move | null {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  return dx === 0 && dy === 0 ? null : { about: from, turnDeg: 90 - Math.atan2(dy, dx) / DEG };
}

type Rows = readonly (readonly number[])[];

function product(a: Rows, b: Rows): number[][] {
  return a.map((row) => [0, 1, 2].map((j) => row.reduce((sum, part, k) => sum + part * (b[k]?.[j] ?? 0), 0)));
}

function inverse(rows: Rows): number[][] | null {
  const at = (i: number, j: number) => rows[i % 3]?.[j % 3] ?? 0;
  const minor = (i: number, j: number) => at(i + 1, j + 1) * at(i + 2, j + 2) - at(i + 1, j + 2) * at(i + 2, j + 1);
  const determinant = [0, 1, 2].reduce((sum, j) => sum + at(0, j) * minor(0, j), 0);
  if (determinant === 0) return null;
  return [0, 1, 2].map((i) => [0, 1, 2].map((j) => minor(j, i) / determinant));
}

/** From pixels of a picture to the world, as rows of a homography; null where it is not known. */
export function worldFromPixel(map: PlaneMap, [width, height]: Corner): number[][] | null {
  const back = inverse(map.rows);
  if (!back) return null;
  const shift = [[1, 0, map.origin[0]], [0, 1, map.origin[1]], [0, 0, 1]];
  return product(product(shift, back), [[1 / width, 0, 0], [0, 1 / height, 0], [0, 0, 1]]);
}

export function applied(rows: Rows, [x, y]: Corner): Corner {
  const [u = 0, v = 0, q = 1] = rows.map((row) => (row[0] ?? 0) * x + (row[1] ?? 0) * y + (row[2] ?? 0));
  return [u / q, v / q];
}

/** The pixel that lies at a place. */
export function pixelAt(map: PlaneMap, [width, height]: Corner, place: Corner): Corner {
  const [s, t, q] = textureAt(map, [place[0], place[1]]);
  return [(s / q) * width, (t / q) * height];
}

/** A picture's place in words: middle, metres a pixel, and where its upper edge points, degrees from north towards west. */
export function described(rows: Rows, [width, height]: Corner): { middle: Corner; metresPerPixel: number; turnDeg: number } {
  const middle = applied(rows, [width / 2, height / 2]);
  const up = applied(rows, [width / 2, height / 2 - 1]);
  const right = applied(rows, [width / 2 + 1, height / 2]);
  const [ux, uy] = [up[0] - middle[0], up[1] - middle[1]];
  const [rx, ry] = [right[0] - middle[0], right[1] - middle[1]];
  const turnDeg = Math.atan2(uy, ux) / DEG - 90;
  return { middle, metresPerPixel: Math.sqrt(Math.abs(rx * uy - ry * ux)), turnDeg: turnDeg <= -180 ? turnDeg + 360 : turnDeg };
}

/** Root of the mean square of what the points miss, metres. */
export function residual(rows: Rows, imagery: Imagery): number {
  const squares = (imagery.control_points ?? []).map(({ pixel, world }) => {
    const [x, y] = applied(rows, [pixel[0] ?? 0, pixel[1] ?? 0]);
    return (x - (world[0] ?? 0)) ** 2 + (y - (world[1] ?? 0)) ** 2;
  });
  return squares.length === 0 ? 0 : Math.sqrt(squares.reduce((sum, square) => sum + square, 0) / squares.length);
}
