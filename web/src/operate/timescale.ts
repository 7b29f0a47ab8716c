// The timeline's arithmetic: a stretch of time, milliseconds since 1970, shown over a width.

export type Stretch = { readonly from: number; readonly to: number };

/** Least and most that is shown at once: a frame or two, and two months. */
export const LEAST_MILLIS = 400;
export const MOST_MILLIS = 61 * 86_400_000;

const STEPS_MILLIS = [
  40, 100, 200, 500, 1e3, 2e3, 5e3, 10e3, 15e3, 30e3, 60e3, 120e3, 300e3, 600e3, 900e3, 1_800e3, 3_600e3, 7_200e3, 10_800e3,
  21_600e3, 43_200e3, 86_400e3, 172_800e3, 604_800e3,
] as const;

/** The stretch zoomed so that `millis` stays where it is; above 1 shows more. */
export function zoomed({ from, to }: Stretch, millis: number, factor: number): Stretch {
  const length = Math.min(Math.max((to - from) * factor, LEAST_MILLIS), MOST_MILLIS);
  const share = (millis - from) / (to - from);
  return { from: millis - share * length, to: millis + (1 - share) * length };
}

/** The same length, elsewhere. */
export function shifted({ from, to }: Stretch, millis: number): Stretch {
  return { from: from + millis, to: to + millis };
}

/** The same stretch, moved as little as brings `millis` well into it. */
export function following(stretch: Stretch, millis: number): Stretch {
  const length = stretch.to - stretch.from;
  if (millis > stretch.to - 0.05 * length) return shifted(stretch, millis - (stretch.to - 0.05 * length));
  if (millis < stretch.from) return shifted(stretch, millis - (stretch.from + 0.05 * length));
  return stretch;
}

/** Where ticks stand, at round times of the viewer's clock, at most `most` of them; and how far they are apart. */
export function ticks({ from, to }: Stretch, most: number): { at: number[]; step: number } {
  const step = STEPS_MILLIS.find((length) => (to - from) / length <= most) ?? 2_419_200e3;
  const zone = new Date(from).getTimezoneOffset() * 60e3;
  const at = [];
  for (let tick = Math.ceil((from - zone) / step) * step + zone; tick <= to; tick += step) at.push(tick);
  return { at, step };
}

const two = (n: number) => String(n).padStart(2, "0");

/** A tick's time, as exactly as its distance from the next one asks for. */
export function label(millis: number, step: number): string {
  const at = new Date(millis);
  const day = `${two(at.getMonth() + 1)}-${two(at.getDate())}`;
  if (step >= 86_400e3) return day;
  const minutes = `${two(at.getHours())}:${two(at.getMinutes())}`;
  if (step >= 60e3) return minutes === "00:00" ? day : minutes;
  const seconds = `${minutes}:${two(at.getSeconds())}`;
  return step >= 1e3 ? seconds : `${seconds}.${String(at.getMilliseconds()).padStart(3, "0")}`;
}

/** What there is of a camera's time: from when to when it can be shown, in order; and how much moved. */
export type Row = {
  readonly camera: string;
  readonly ranges: readonly (readonly [from: number, to: number])[];
  readonly activity: readonly { readonly at: number; readonly share: number }[];
};

/** A frame answers for times so far beside its own. */
const ANSWERS_MILLIS = 1_000;

/** Whether any camera can be shown at that time. */
export function isCovered(rows: readonly Row[], millis: number): boolean {
  return rows.some(({ ranges }) => ranges.some(([from, to]) => millis >= from - ANSWERS_MILLIS && millis <= to + ANSWERS_MILLIS));
}

/** The time nearest to `millis` at which any camera can be shown; null where there is none. */
export function nearestCovered(rows: readonly Row[], millis: number): number | null {
  let found: number | null = null;
  for (const [from, to] of rows.flatMap(({ ranges }) => ranges)) {
    const nearest = Math.min(Math.max(millis, from), to);
    if (found === null || Math.abs(nearest - millis) < Math.abs(found - millis)) found = nearest;
  }
  return found;
}

/** Where one of the cameras (null: any) can be shown again beyond a gap; null where it cannot. */
export function beyondGap(rows: readonly Row[], cameras: readonly string[] | null, millis: number, direction: 1 | -1): number | null {
  const ranges = rows.filter(({ camera }) => cameras?.includes(camera) ?? true).flatMap((row) => row.ranges);
  if (direction > 0) {
    const starts = ranges.map(([from]) => from).filter((from) => from > millis + ANSWERS_MILLIS / 2);
    return starts.length > 0 ? Math.min(...starts) : null;
  }
  const ends = ranges.map(([, to]) => to).filter((to) => to < millis - ANSWERS_MILLIS / 2);
  return ends.length > 0 ? Math.max(...ends) : null;
}
