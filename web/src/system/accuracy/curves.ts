// The table of accuracy as curves: what each setting of a stage costs and what error it leaves.

import type { components } from "../../contract.gen";

export type Table = NonNullable<components["schemas"]["Accuracy"]["table"]>;
export type Row = Table["rows"][number];

export type Point = {
  readonly knob: string;
  readonly value: string;
  readonly isDefault: boolean;
  readonly millis: number;
  readonly lower: number;
  readonly upper: number;
  readonly error: number;
};
/** `lines`: settings of one knob, the cheapest first, that are joined; a whole pipeline's are its front. */
export type Curve = { readonly stage: string; readonly points: readonly Point[]; readonly lines: readonly (readonly Point[])[]; readonly unjudged: number };

/** The knob of rows that set everything at once. */
const WHOLE = "whole";

/** Points that no other beats in time and error both, the fastest first. */
export function front(points: readonly Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a.millis - b.millis || a.error - b.error);
  return sorted.filter((point, i) => sorted.slice(0, i).every((faster) => faster.error > point.error));
}

/** Curves of all stages, in the table's order. */
export function curves(table: Table): Curve[] {
  return [...new Set(table.rows.map(({ stage }) => stage))].map((stage) => {
    const rows = table.rows.filter((row) => row.stage === stage);
    const points = rows.filter((row) => row.error !== null).map((row) => ({
      knob: row.knob, value: row.value, isDefault: row.is_default,
      millis: row.time_ms.median, lower: row.time_ms.lower_quartile, upper: row.time_ms.upper_quartile, error: row.error ?? 0,
    }));
    const knobs = [...new Set(points.map(({ knob }) => knob))];
    const lines = knobs.map((knob) => {
      const own = points.filter((point) => point.knob === knob);
      return knob === WHOLE ? front(own) : [...own].sort((a, b) => a.millis - b.millis);
    });
    return { stage, points, lines, unjudged: rows.length - points.length };
  });
}

/** Root mean square of the difference of two pictures' codes, transparency left out. */
export function rmse(one: Uint8ClampedArray, other: Uint8ClampedArray): number {
  const length = Math.min(one.length, other.length);
  let sum = 0;
  for (let i = 0; i < length; i += 1) if (i % 4 !== 3) sum += ((one[i] ?? 0) - (other[i] ?? 0)) ** 2;
  return Math.sqrt(sum / Math.max((length * 3) / 4, 1));
}
