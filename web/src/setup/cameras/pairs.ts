// Pairs of picture points and places: how many are needed, how far each misses by a calibration, and what makes them poor. Picture
// points in pixels of the calibration's size, from the upper left corner; places in metres.

import type { Point } from "../../operate/orbit";
import { type Lens, type Ray, project, ray } from "../../spatial/lens";
import type { Calibrating, Calibration, Pair } from "../draft";
import { cross, dot, length, minus, point } from "./torch";

export type Pixel = readonly [number, number];
/** Where the place lies in the picture less where it was clicked, and how far it lies from the line of sight; null where the
 * camera does not show the place at all. */
export type Miss = { readonly offset_px: Pixel; readonly distance_m: number } | null;
export type Fit = {
  readonly misses: readonly Miss[];
  /** Root of the mean square; null where there are no pairs, or some place is not shown. */
  readonly rms_px: number | null;
  readonly rms_m: number | null;
  /** Which pair misses most, counted from 0; null of fewer than two, and where none misses by a pixel. */
  readonly worst: number | null;
};

/** Colours that differ from one another and, with a dark border, from pictures. */
const COLORS = ["#ffd23f", "#4cc9f0", "#ff6b9d", "#7ae582", "#ff9f45", "#c59bff", "#f2f2f2", "#2dd4bf"] as const;
/** Clicks are not surer than that: below it none is called the worst. */
const LEAST_WORST_PX = 1;
/** Pairs narrower than this share of the picture tell little of the lens. */
const LEAST_SPREAD = 0.3;
/** Breadth over length below which points lie almost on a line. */
const LINE_SHARE = 0.06;

/** The colour of the pair that stands so many from the first. */
export const color = (idx: number): string => COLORS[idx % COLORS.length] ?? COLORS[0];

/** The fewest pairs that find what is asked for; one more than numbers alone need, to tell whether they fit. */
export function least({ findsFocal, findsK1 }: Pick<Calibrating, "findsFocal" | "findsK1">): number {
  if (findsFocal) return findsK1 ? 7 : 6;
  return findsK1 ? 6 : 4;
}

/** Where a place lies in the picture or beside it, pixels. */
export function pixelOf(lens: Lens, place: Point): Pixel | null {
  const shown = project(lens, place);
  return shown && [shown.u * lens.size[0], shown.v * lens.size[1]];
}

/** What may stand at a pixel. */
export function sight(lens: Lens, [x, y]: Pixel): Ray | null {
  return ray(lens, [x / lens.size[0], y / lens.size[1]]);
}

function missOf(lens: Lens, { picture_px, place_m }: Pair): Miss {
  const [shown, through] = [pixelOf(lens, place_m), sight(lens, picture_px)];
  if (!shown || !through) return null;
  const across = cross(minus(place_m, lens.position), through.direction);
  return { offset_px: [shown[0] - picture_px[0], shown[1] - picture_px[1]], distance_m: length(across) };
}

const root = (squares: readonly number[]) => Math.sqrt(squares.reduce((sum, square) => sum + square, 0) / squares.length);

/** How well a camera fits pairs. */
export function fit(lens: Lens, pairs: readonly Pair[]): Fit {
  const misses = pairs.map((pair) => missOf(lens, pair));
  const known = misses.filter((miss) => miss !== null);
  const isWhole = known.length === pairs.length && pairs.length > 0;
  const size = (miss: Miss) => (miss ? Math.hypot(...miss.offset_px) : Infinity);
  const sizes = misses.map(size);
  return {
    misses,
    rms_px: isWhole ? root(known.map((miss) => size(miss) ** 2)) : null,
    rms_m: isWhole ? root(known.map(({ distance_m }) => distance_m ** 2)) : null,
    worst: pairs.length > 1 && Math.max(...sizes) > LEAST_WORST_PX ? sizes.indexOf(Math.max(...sizes)) : null,
  };
}

/** How long and how broad a cloud of points is, along its own axes (the moments' eigenvalues). */
function extents(points: readonly Pixel[]): [number, number] {
  const n = Math.max(points.length, 1);
  const [mx, my] = [points.reduce((sum, [x]) => sum + x, 0) / n, points.reduce((sum, [, y]) => sum + y, 0) / n];
  const sum = (of: (x: number, y: number) => number) => points.reduce((total, [x, y]) => total + of(x - mx, y - my), 0) / n;
  const [xx, yy, xy] = [sum((x) => x * x), sum((_, y) => y * y), sum((x, y) => x * y)];
  const [middle, apart] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  return [Math.sqrt(middle + apart), Math.sqrt(Math.max(middle - apart, 0))];
}

export type Poverty = "line" | "narrow";

/** What makes pairs poor: that they lie almost on a line, in the picture or in the world, or in one corner of the picture. */
export function poverty(pairs: readonly Pair[], sizePx: Pixel): Poverty | null {
  if (pairs.length < 3) return null;
  const [long, broad] = extents(pairs.map(({ picture_px }) => picture_px));
  if (broad < LINE_SHARE * long || onLine(pairs.map(({ place_m }) => place_m))) return "line";
  // Four standard deviations are about what the points take up.
  return 4 * long < LEAST_SPREAD * Math.hypot(...sizePx) ? "narrow" : null;
}

/** Whether places lie almost on one line, however it runs. */
function onLine(places: readonly Point[]): boolean {
  const first = places[0] ?? [0, 0, 0];
  const farthest = places.reduce((far, place) => (length(minus(place, first)) > length(minus(far, first)) ? place : far), first);
  const along = minus(farthest, first);
  const reach = length(along);
  if (reach === 0) return true;
  const beside = Math.max(...places.map((place) => length(cross(minus(place, first), along)) / reach));
  return beside < LINE_SHARE * reach;
}

/** Pairs as a pinhole with a calibration's focal length and its principal point in the middle would show them: how a lens that is
 * kept as it is comes to a solver that knows pinholes. Null where the lens shows nothing at one of them. */
export function asPinhole(lens: Lens, focalPx: number, pairs: readonly Pair[]): Pair[] | null {
  const straight: Pair[] = [];
  for (const { picture_px, place_m } of pairs) {
    const through = sight(lens, picture_px);
    const [x, y, z] = through ? ([0, 1, 2] as const).map((i) => dot(lens.axes[i], through.direction)) : [];
    if (x === undefined || y === undefined || z === undefined || z < 1e-3) return null;
    const [width, height] = lens.size;
    straight.push({ picture_px: [width / 2 + (focalPx * x) / z, height / 2 + (focalPx * y) / z], place_m });
  }
  return straight;
}

/** Pairs after their picture has got another size. */
export function scaled(pairs: readonly Pair[], from: Pixel, to: Pixel): readonly Pair[] {
  if (from[0] === to[0] && from[1] === to[1]) return pairs;
  return pairs.map(({ picture_px: [x, y], place_m }) => ({ picture_px: [(x * to[0]) / from[0], (y * to[1]) / from[1]], place_m }));
}

/** Where a camera of known direction and lens stands: at a height over one place that it shows, or nearest to all lines of sight
 * from two places on. Null where that leaves it open. */
export function standing(lens: Lens, pairs: readonly Pair[], height_m: number | null): Point | null {
  const sights = pairs.flatMap(({ picture_px, place_m }) => {
    const through = sight(lens, picture_px);
    return through ? [{ place: place_m, toward: through.direction }] : [];
  });
  const only = sights[0];
  if (only && (sights.length === 1 || height_m !== null)) {
    if (height_m === null) return null;
    const reaches = sights.map(({ place, toward }) => (place[2] - height_m) / toward[2]);
    if (!reaches.every((reach) => reach > 0 && Number.isFinite(reach))) return null;
    const spots = sights.map(({ place, toward }, i) => minus(place, scale(toward, reaches[i] ?? 0)));
    return mean(spots);
  }
  return only ? nearest(sights) : null;
}

const scale = (of: Point, by: number): Point => [of[0] * by, of[1] * by, of[2] * by];
const mean = (of: readonly Point[]): Point => point([0, 1, 2].map((i) => of.reduce((sum, spot) => sum + (spot[i] ?? 0), 0) / of.length));

/** The point nearest to lines: the sum of their projections across is solved by Cramer's rule. */
function nearest(lines: readonly { place: Point; toward: Point }[]): Point | null {
  const middle = mean(lines.map(({ place }) => place));
  const rows = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  const right = [0, 0, 0];
  for (const { place, toward } of lines) {
    const from = minus(place, middle);
    for (let i = 0; i < 3; i += 1) {
      for (let j = 0; j < 3; j += 1) {
        const across = (i === j ? 1 : 0) - (toward[i] ?? 0) * (toward[j] ?? 0);
        const row = rows[i];
        if (row) row[j] = (row[j] ?? 0) + across;
        right[i] = (right[i] ?? 0) + across * (from[j] ?? 0);
      }
    }
  }
  const columns = [0, 1, 2].map((j) => point(rows.map((row) => row[j] ?? 0)));
  const whole = determinant(columns);
  if (whole < 1e-9 * lines.length ** 3) return null;
  const solved = [0, 1, 2].map((j) => determinant(columns.map((column, i) => (i === j ? point(right) : column))) / whole);
  return point(solved.map((value, i) => value + (middle[i] ?? 0)));
}

const determinant = ([a = [0, 0, 0], b = [0, 0, 0], c = [0, 0, 0]]: readonly Point[]) => dot(a, cross(b, c));

/** A calibration for the same picture in another size. */
export function resized(of: Calibration, to: Pixel): Calibration {
  const [width, height] = sizeOf(of);
  if (width === to[0] && height === to[1]) return of;
  const scale = (numbers: readonly number[]) => [((numbers[0] ?? 0) * to[0]) / width, ((numbers[1] ?? 0) * to[1]) / height];
  return { ...of, image_size_px: [...to], focal_px: scale(of.focal_px), center_px: scale(of.center_px) };
}

/** A calibration's size in pixels. */
export const sizeOf = ({ image_size_px: [width = 1, height = 1] }: Calibration): Pixel => [width, height];
