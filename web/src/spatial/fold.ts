// Where a lens model stops being one to one: the twin of src/geometry/distortion/limit.rs. Every bound errs towards the axis, so
// that nothing from beyond the fold is ever shown.

type Terms = readonly number[];

/** Sectors of directions in which the fold's radius is kept where it depends on the direction. */
const SECTORS = 128;
/** A model that folds back nearer to the axis than this is none. */
const SMALLEST_REACH = 1e-3;
/** Radii beyond this are not told apart: 0.006 degrees from the picture's plane. */
const FARTHEST_RADIUS = 1e4;

/** Beyond which radius of the pinhole's picture a lens folds back, units of the focal length. */
export type Fold = {
  /** In every direction. */
  readonly maxRadius: number;
  /** The same as an angle off the axis, radians: at most pi of a fisheye, pi / 2 else. */
  readonly maxTheta: number;
  /** By direction from the x axis towards y; null where one radius holds for all. */
  readonly sectors: readonly number[] | null;
};

export const UNFOLDED: Fold = { maxRadius: Infinity, maxTheta: Math.PI / 2, sectors: null };

/** Whether the model is one to one from the axis out to here. */
export function isWithin({ maxRadius, sectors }: Fold, x: number, y: number): boolean {
  const radius = Math.hypot(x, y);
  if (!Number.isFinite(radius)) return false;
  if (radius <= maxRadius) return true;
  if (!sectors) return false;
  const turn = Math.atan2(y, x) / (2 * Math.PI) + 1;
  return radius <= (sectors[Math.floor(turn * SECTORS) % SECTORS] ?? 0);
}

/** Of OpenCV's fisheye, k1 to k4; null of what is no lens. */
export function fisheyeFold([k1 = 0, k2 = 0, k3 = 0, k4 = 0]: Terms): Fold | null {
  const reach = rootFreeReach([1, 3 * k1, 5 * k2, 7 * k3, 9 * k4], Math.PI * Math.PI);
  if (reach === null) return null;
  const maxTheta = Math.min(Math.sqrt(reach), Math.PI);
  const maxRadius = maxTheta < Math.PI / 2 ? Math.tan(maxTheta) : Infinity;
  return maxTheta >= SMALLEST_REACH ? { maxRadius, maxTheta, sectors: null } : null;
}

/** Of Brown and Conrady's model, k1 k2 p1 p2 k3 k4 k5 k6; null of what is no lens. */
export function brownConradyFold(k: Terms): Fold | null {
  const [p1, p2] = [k[2] ?? 0, k[3] ?? 0];
  if (p1 === 0 && p2 === 0) return withRadius(foldRadius(k, 0, 0), null);
  // Within a sector the tangential terms differ from their values in its middle by at most their size times half its angle.
  const half = Math.PI / SECTORS;
  const slack = Math.hypot(p1, p2) * half;
  const sectors: number[] = [];
  for (let sector = 0; sector < SECTORS; sector += 1) {
    const [sine, cosine] = [Math.sin((2 * sector + 1) * half), Math.cos((2 * sector + 1) * half)];
    const radius = foldRadius(k, p2 * cosine + p1 * sine - slack, Math.abs(p2 * sine - p1 * cosine) + slack);
    if (radius === null) return null;
    sectors.push(radius);
  }
  return withRadius(Math.min(...sectors), sectors);
}

function withRadius(maxRadius: number | null, sectors: number[] | null): Fold | null {
  if (maxRadius === null || maxRadius < SMALLEST_REACH) return null;
  return { maxRadius, maxTheta: Math.atan(maxRadius), sectors };
}

/** The first zero of the Jacobian's determinant, or pole, for given tangential terms along and across a direction. */
function foldRadius(k: Terms, along: number, across: number): number | null {
  const [k1 = 0, k2 = 0, , , k3 = 0, k4 = 0, k5 = 0, k6 = 0] = k;
  const pole = rootFreeReach([1, k4, k5, k6], FARTHEST_RADIUS ** 2);
  if (pole === null) return null;
  // Polynomials in the radius; all is multiplied by the denominator's cube, which is positive before the pole.
  const above = [1, 0, k1, 0, k2, 0, k3];
  const below = [1, 0, k4, 0, k5, 0, k6];
  const aboveSlope = [0, 0, 2 * k1, 0, 4 * k2, 0, 6 * k3];
  const belowSlope = [0, 0, 2 * k4, 0, 4 * k5, 0, 6 * k6];
  const squared = product(below, below);
  const outwards = sum(
    sum(product(above, below), product(aboveSlope, below)),
    sum(product([-1], product(above, belowSlope)), product([0, 6 * along], squared)),
  );
  const around = sum(above, product([0, 2 * along], below));
  const mixed = product([0, 0, -4 * across * across], product(squared, below));
  const reach = rootFreeReach(sum(product(outwards, around), mixed), FARTHEST_RADIUS);
  return reach === null ? null : Math.min(reach, Math.sqrt(pole));
}

/** How far from 0 a polynomial (constant term 1, ascending powers) certainly has no zero; `farthest` where the first lies beyond,
 * Infinity where there is none, null where a coefficient is not finite. */
export function rootFreeReach(polynomial: Terms, farthest: number): number | null {
  const terms = [...polynomial];
  let reach = 0;
  for (let round = 0; round < 256; round += 1) {
    if (!terms.every(Number.isFinite)) return null;
    const step = safeStep(terms);
    reach += step;
    if (reach === Infinity) return reach;
    if (reach >= farthest) return farthest;
    if (step <= 1e-13 * reach) break;
    expandAt(terms, step);
  }
  // The expansions' rounding may have carried it over the root by a few units of the last place.
  return reach * (1 - 1e-11);
}

/** A step within which the falling terms do not use up the constant term. */
function safeStep([constant = 0, ...rising]: Terms): number {
  if (constant <= 0) return 0;
  const rest = (step: number) => constant + rising.reduceRight((total, term) => (total + Math.min(term, 0)) * step, 0);
  let high = Infinity;
  rising.forEach((term, i) => {
    if (term < 0) high = Math.min(high, (constant / -term) ** (1 / (i + 1)));
  });
  if (high === Infinity) return high;
  let low = 0;
  for (let halving = 0; halving < 24; halving += 1) {
    const middle = 0.5 * (low + high);
    if (rest(middle) > 0) low = middle;
    else high = middle;
  }
  return low;
}

/** The polynomial's terms around `offset`, by repeated synthetic division. */
function expandAt(terms: number[], offset: number): void {
  for (let first = 0; first < terms.length; first += 1) {
    for (let i = terms.length - 2; i >= first; i -= 1) terms[i] = (terms[i] ?? 0) + offset * (terms[i + 1] ?? 0);
  }
}

function product(a: Terms, b: Terms): number[] {
  const terms = new Array<number>(a.length + b.length - 1).fill(0);
  a.forEach((x, i) => b.forEach((y, j) => (terms[i + j] = (terms[i + j] ?? 0) + x * y)));
  return terms;
}

function sum(a: Terms, b: Terms): number[] {
  return Array.from({ length: Math.max(a.length, b.length) }, (_, i) => (a[i] ?? 0) + (b[i] ?? 0));
}
