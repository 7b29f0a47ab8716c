// Where a picture lies on the plan of the world: the twin of src/geometry/registration.rs, and of its pictures between bounds.

import type { components } from "../contract.gen";
import type { Pair } from "./distortion";

export type Imagery = components["schemas"]["Imagery"];
/** Rows of a homography; it takes world x and y, less `origin`, to homogeneous texture coordinates. */
export type PlaneMap = { readonly origin: Pair; readonly rows: readonly (readonly [number, number, number])[] };
type Matched = { readonly texture: Pair; readonly world: Pair };

/** From so many control points on a picture is bent, where nothing else is said. */
const HOMOGRAPHY_FROM = 6;
/** Places each way at which bounds are laid over the level world. */
const BOUNDS_PLACES = 9;
const MOST_STEPS = 30;
const SEMI_MAJOR_M = 6_378_137;
const SQUARED_ECCENTRICITY = (2 - 1 / 298.257223563) / 298.257223563;

/** The homogeneous texture coordinate of a world place: s / q and t / q, from the picture's upper left corner. */
export function textureAt({ origin, rows }: PlaneMap, [x, y]: Pair): [number, number, number] {
  const [dx, dy] = [x - origin[0], y - origin[1]];
  const at = (i: number) => (rows[i]?.[0] ?? 0) * dx + (rows[i]?.[1] ?? 0) * dy + (rows[i]?.[2] ?? 0);
  return [at(0), at(1), at(2)];
}

/** Where imagery lies that has so many pixels; null where its points do not tell, or bounds have no origin on the earth. */
export function mapOf(imagery: Imagery, size: Pair, origin: { latitude_deg: number; longitude_deg: number; height_m?: number } | undefined): PlaneMap | null {
  if (imagery.bounds) return origin ? register(betweenBounds(imagery.bounds, origin), true) : null;
  const points = (imagery.control_points ?? []).map(({ pixel, world }): Matched => ({
    texture: [(pixel[0] ?? 0) / size[0], (pixel[1] ?? 0) / size[1]],
    world: [world[0] ?? 0, world[1] ?? 0],
  }));
  return register(points, imagery.transform ? imagery.transform === "homography" : points.length >= HOMOGRAPHY_FROM);
}

/** The plan's map with least squares of the distances in the world; null of points that do not determine it. */
export function register(points: readonly Matched[], isBent: boolean): PlaneMap | null {
  if (points.length < (isBent ? 4 : 3)) return null;
  const [from, to] = [normal(points.map(({ texture }) => texture)), normal(points.map(({ world }) => world))];
  if (!from || !to) return null;
  const pairs = points.map(({ texture, world }): [Pair, Pair] => [from.of(texture), to.of(world)]);
  const forth = isBent ? homography(pairs) : affine(pairs);
  const back = forth && inverse(forth);
  if (!back) return null;
  // texture = from^-1 * back * (world - middle) / scale
  const { middle, scale } = from;
  const mixed = [0, 1].map((i) => [0, 1, 2].map((j) => scale * at(back, i, j) + (middle[i] ?? 0) * at(back, 2, j)));
  const rows = [...mixed, [0, 1, 2].map((j) => at(back, 2, j))];
  const unit = at(rows, 2, 2) || 1;
  return {
    origin: to.middle,
    rows: rows.map((row) => [(row[0] ?? 0) / to.scale / unit, (row[1] ?? 0) / to.scale / unit, (row[2] ?? 0) / unit]),
  };
}

const at = (rows: readonly (readonly number[])[], i: number, j: number) => rows[i]?.[j] ?? 0;

/** What moves points to about 0 and their distances to about 1. */
function normal(points: readonly Pair[]): { middle: Pair; scale: number; of: (point: Pair) => Pair } | null {
  const mean = (axis: 0 | 1) => points.reduce((sum, point) => sum + point[axis], 0) / points.length;
  const middle: Pair = [mean(0), mean(1)];
  const squares = points.reduce((sum, [x, y]) => sum + (x - middle[0]) ** 2 + (y - middle[1]) ** 2, 0);
  const scale = Math.sqrt(squares / points.length);
  if (!(scale > 0)) return null;
  return { middle, scale, of: ([x, y]) => [(x - middle[0]) / scale, (y - middle[1]) / scale] };
}

function affine(pairs: readonly [Pair, Pair][]): number[][] | null {
  const rows = ([0, 1] as const).map((axis) => leastSquares(pairs.map(([[x, y], to]) => ({ row: [x, y, 1], value: to[axis] }))));
  return rows[0] && rows[1] ? [rows[0], rows[1], [0, 0, 1]] : null;
}

/** By the direct linear transformation, then by Gauss-Newton steps on the distances while they help. */
function homography(pairs: readonly [Pair, Pair][]): number[][] | null {
  const matrix = (h: readonly number[]) => [h.slice(0, 3), h.slice(3, 6), [...h.slice(6, 8), 1]];
  const shown = (h: readonly number[], [x, y]: Pair): [number, number, number] => {
    const rows = matrix(h).map((row) => (row[0] ?? 0) * x + (row[1] ?? 0) * y + (row[2] ?? 0));
    const q = rows[2] ?? 1;
    return [(rows[0] ?? 0) / q, (rows[1] ?? 0) / q, q];
  };
  const equations = (h: readonly number[] | null) => pairs.flatMap(([from, to]) => {
    const [u, v, q] = h ? shown(h, from) : [to[0], to[1], 1];
    const [x, y, one] = [from[0] / q, from[1] / q, 1 / q];
    return [
      { row: [x, y, one, 0, 0, 0, -u * x, -u * y], value: h ? to[0] - u : to[0] },
      { row: [0, 0, 0, x, y, one, -v * x, -v * y], value: h ? to[1] - v : to[1] },
    ];
  });
  const missed = (h: readonly number[]) => pairs.reduce((sum, [from, to]) => {
    const [u, v] = shown(h, from);
    return sum + (u - to[0]) ** 2 + (v - to[1]) ** 2;
  }, 0);
  let best = leastSquares(equations(null));
  for (let round = 0; best && round < MOST_STEPS; round += 1) {
    const step = leastSquares(equations(best));
    const next = step && best.map((part, i) => part + (step[i] ?? 0));
    if (!next || !(missed(next) < missed(best))) break;
    best = next;
  }
  return best && matrix(best);
}

/** By normal equations with pivots; what is normalised before is well enough conditioned for them. */
function leastSquares(equations: readonly { row: readonly number[]; value: number }[]): number[] | null {
  const count = equations[0]?.row.length ?? 0;
  const system = Array.from({ length: count }, (_, i) => [
    ...Array.from({ length: count }, (_, j) => equations.reduce((sum, { row }) => sum + (row[i] ?? 0) * (row[j] ?? 0), 0)),
    equations.reduce((sum, { row, value }) => sum + (row[i] ?? 0) * value, 0),
  ]);
  const largest = Math.max(...system.map((row, i) => row[i] ?? 0));
  for (let i = 0; i < count; i += 1) {
    let pivot = i;
    for (let j = i + 1; j < count; j += 1) if (Math.abs(at(system, j, i)) > Math.abs(at(system, pivot, i))) pivot = j;
    const [row, other] = [system[pivot] ?? [], system[i] ?? []];
    [system[i], system[pivot]] = [row, other];
    const head = row[i] ?? 0;
    if (!(Math.abs(head) > 1e-13 * largest)) return null;
    for (const below of system) {
      if (below === row) continue;
      const factor = (below[i] ?? 0) / head;
      for (let j = i; j <= count; j += 1) below[j] = (below[j] ?? 0) - factor * (row[j] ?? 0);
    }
  }
  return system.map((row, i) => (row[count] ?? 0) / (row[i] ?? 1));
}

/** Of a matrix of three rows; null of a singular one. */
function inverse(rows: readonly (readonly number[])[]): number[][] | null {
  const minor = (i: number, j: number) => {
    const [a, b] = [0, 1, 2].filter((row) => row !== j);
    const [c, d] = [0, 1, 2].filter((column) => column !== i);
    const part = at(rows, a ?? 0, c ?? 0) * at(rows, b ?? 0, d ?? 0) - at(rows, a ?? 0, d ?? 0) * at(rows, b ?? 0, c ?? 0);
    return (i + j) % 2 === 0 ? part : -part;
  };
  const determinant = [0, 1, 2].reduce((sum, j) => sum + at(rows, 0, j) * minor(j, 0), 0);
  if (!(Math.abs(determinant) > 1e-9)) return null;
  return [0, 1, 2].map((i) => [0, 1, 2].map((j) => minor(i, j) / determinant));
}

/** Places of a picture of even steps in longitude and latitude, laid over the plane that touches the earth in the origin. */
function betweenBounds(bounds: NonNullable<Imagery["bounds"]>, origin: { latitude_deg: number; longitude_deg: number; height_m?: number }): Matched[] {
  const across = (((bounds.east_deg - bounds.west_deg) % 360) + 360) % 360;
  const share = (i: number) => i / (BOUNDS_PLACES - 1);
  return Array.from({ length: BOUNDS_PLACES ** 2 }, (_, i): Matched => {
    const texture: Pair = [share(i % BOUNDS_PLACES), share(Math.floor(i / BOUNDS_PLACES))];
    const latitude = bounds.north_deg + texture[1] * (bounds.south_deg - bounds.north_deg);
    return { texture, world: eastNorth(origin, latitude, bounds.west_deg + texture[0] * across) };
  });
}

/** Metres east and north of the origin, of a place of its height. */
function eastNorth(origin: { latitude_deg: number; longitude_deg: number; height_m?: number }, latitudeDeg: number, longitudeDeg: number): Pair {
  const rad = Math.PI / 180;
  const height = origin.height_m ?? 0;
  const geocentric = (latitude: number, longitude: number) => {
    const [sine, cosine] = [Math.sin(latitude * rad), Math.cos(latitude * rad)];
    const radius = SEMI_MAJOR_M / Math.sqrt(1 - SQUARED_ECCENTRICITY * sine * sine);
    const around = (radius + height) * cosine;
    return [around * Math.cos(longitude * rad), around * Math.sin(longitude * rad), (radius * (1 - SQUARED_ECCENTRICITY) + height) * sine] as const;
  };
  const [here, there] = [geocentric(origin.latitude_deg, origin.longitude_deg), geocentric(latitudeDeg, longitudeDeg)];
  const [x, y, z] = [there[0] - here[0], there[1] - here[1], there[2] - here[2]];
  const [sine, cosine] = [Math.sin(origin.latitude_deg * rad), Math.cos(origin.latitude_deg * rad)];
  const [sideways, ahead] = [Math.sin(origin.longitude_deg * rad), Math.cos(origin.longitude_deg * rad)];
  return [y * ahead - x * sideways, cosine * z - sine * (x * ahead + y * sideways)];
}
