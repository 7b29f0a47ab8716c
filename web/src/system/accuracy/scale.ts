// Axes: from values to places, and which values are written beside them.

export type Scale = { readonly isLog: boolean; readonly least: number; readonly most: number };

/** Beyond this ratio of the greatest to the least a scale is logarithmic. */
const LOG_FROM = 8;

/** A scale that holds all values, with room at both ends. */
export function scaleOf(values: readonly number[]): Scale {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  if (values.length === 0) return { isLog: false, least: 0, most: 1 };
  if (least > 0 && most / least > LOG_FROM) return { isLog: true, least: least / 1.3, most: most * 1.3 };
  const room = Math.max((most - least) * 0.12, Math.abs(most) * 0.02, 1e-9);
  return { isLog: false, least: least >= 0 ? Math.max(least - room, 0) : least - room, most: most + room };
}

/** The place of a value, 0 to 1. */
export function at({ isLog, least, most }: Scale, value: number): number {
  return isLog ? Math.log(value / least) / Math.log(most / least) : (value - least) / (most - least);
}

/** Round values within a scale: 1, 2 and 5 times powers of ten. */
export function ticks({ isLog, least, most }: Scale, count = 5): number[] {
  if (isLog) {
    const decades = Math.log10(most / least);
    const steps = decades > count ? [1] : decades > 1.5 ? [1, 3] : [1, 2, 5];
    const skip = Math.max(Math.ceil(decades / count), 1);
    const first = Math.floor(Math.log10(least));
    const powers = Array.from({ length: Math.ceil(decades) + 2 }, (_, i) => first + i).filter((power) => steps.length > 1 || (power - first) % skip === 0);
    return powers.flatMap((power) => steps.map((step) => step * 10 ** power)).filter((value) => value >= least && value <= most);
  }
  const raw = (most - least) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((by) => by * power).find((by) => by >= raw) ?? raw;
  const first = Math.ceil(least / step);
  return Array.from({ length: Math.floor(most / step) - first + 1 }, (_, i) => (first + i) * step);
}

/** A number with as many digits as tell something. */
export function short(value: number): string {
  if (value === 0) return "0";
  const digits = Math.abs(value) >= 100 ? 0 : Math.abs(value) >= 10 ? 1 : Math.abs(value) >= 0.01 ? 3 : -1;
  return digits < 0 ? value.toExponential(1) : String(Number(value.toFixed(digits)));
}
