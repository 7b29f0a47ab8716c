// Where a place that is drawn or dragged comes to lie: on corners and edges of what stands there, on lines through them, at right
// angles, on the grid. What it came to lie on is told as guides.

import type { SceneDocument } from "../draft";
import type { Corner } from "../plan/frame";
import { type Outline, corner, distance, edges, nearest } from "./outline";
import { type FileExtents, extentOf, things, yawOf } from "./things";

export type Guide = { readonly kind: "corner" | "edge" | "line"; readonly line: readonly [Corner, Corner] };
export type Snapped = { readonly at: Corner; readonly guides: readonly Guide[] };
export type Targets = { readonly corners: readonly Corner[]; readonly edges: readonly (readonly [Corner, Corner])[] };
export type Near = {
  readonly targets: Targets;
  /** How near something must be, metres: a few pixels. */
  readonly reach: number;
  /** Metres; 0 without a grid. */
  readonly grid: number;
};
/** The corner that a line comes from, and the one before it. */
export type From = { readonly last: Corner; readonly before?: Corner | undefined };

type Line = { readonly through: Corner; readonly along: Corner; readonly kind: Guide["kind"]; readonly shown: Corner; readonly isMeasured?: boolean };

const NO_TARGETS: Targets = { corners: [], edges: [] };
const DEGREE = Math.PI / 180;
/** Turns come to lie on these. */
const TURN_STEP_DEG = 15;
const TURN_REACH_DEG = 3;

/** What places may come to lie on: everything but the things that are moved. */
export function targetsOf(document: SceneDocument, except: ReadonlySet<string>, files?: FileExtents): Targets {
  const outlines: Outline[] = (document.ground ?? []).map(({ polygon }) => polygon.map(corner));
  const rounds: Corner[] = [];
  for (const one of things(document)) {
    if (except.has(one.of.id)) continue;
    const { outline, middle } = extentOf(one, files);
    if (one.list === "cylinders") {
      const radius = one.of.radius_m;
      rounds.push(middle, [middle[0] + radius, middle[1]], [middle[0] - radius, middle[1]], [middle[0], middle[1] + radius], [middle[0], middle[1] - radius]);
    } else {
      outlines.push(outline);
    }
  }
  return { corners: [...outlines.flat(), ...rounds], edges: outlines.flatMap(edges) };
}

function gridded(metres: number, grid: number): number {
  return grid > 0 ? Number((Math.round(metres / grid) * grid).toFixed(6)) : metres;
}

function foot({ through, along }: Line, at: Corner): Corner {
  const share = (at[0] - through[0]) * along[0] + (at[1] - through[1]) * along[1];
  return [through[0] + along[0] * share, through[1] + along[1] * share];
}

function crossing(a: Line, b: Line): Corner | null {
  const across = a.along[0] * b.along[1] - a.along[1] * b.along[0];
  if (Math.abs(across) < 1e-3) return null;
  const to: Corner = [b.through[0] - a.through[0], b.through[1] - a.through[1]];
  const share = (to[0] * b.along[1] - to[1] * b.along[0]) / across;
  return [a.through[0] + a.along[0] * share, a.through[1] + a.along[1] * share];
}

function direction(from: Corner, to: Corner): Corner | null {
  const length = distance(from, to);
  return length > 1e-9 ? [(to[0] - from[0]) / length, (to[1] - from[1]) / length] : null;
}

/** Lines on which a place may lie that is drawn on from a corner: along the axes, and square to or along with the edge before. */
function linesFrom({ last, before }: From): Line[] {
  const along = before ? direction(before, last) : null;
  const ways: Corner[] = [...(along ? [[-along[1], along[0]], along] as Corner[] : []), [1, 0], [0, 1]];
  return ways.map((way) => ({ through: last, along: way, kind: "line", shown: last, isMeasured: true }));
}

/** The nearest of lines that are near enough. */
function lineNear(lines: readonly Line[], at: Corner, reach: number): Line | null {
  let best: Line | null = null;
  let least = reach;
  for (const line of lines) {
    const off = distance(foot(line, at), at);
    // Those that come first win where two are as good.
    if (off < least - 1e-9) [best, least] = [line, off];
  }
  return best;
}

function linesOf({ corners, edges: all }: Targets, at: Corner, reach: number): Line[] {
  const onEdges = all.flatMap((edge): Line[] => {
    const along = direction(...edge);
    if (!along || distance(nearest(at, edge).at, at) > reach) return [];
    return [{ through: edge[0], along, kind: "edge", shown: edge[0] }];
  });
  const level = corners.filter(([, y]) => Math.abs(y - at[1]) < reach);
  const upright = corners.filter(([x]) => Math.abs(x - at[0]) < reach);
  const closest = (some: readonly Corner[]) => [...some].sort((a, b) => distance(a, at) - distance(b, at))[0];
  const aligned = (through: Corner | undefined, along: Corner): Line[] => (through ? [{ through, along, kind: "line", shown: through }] : []);
  return [...onEdges, ...aligned(closest(level), [1, 0]), ...aligned(closest(upright), [0, 1])];
}

/** A place that is drawn, where it comes to lie. */
export function snapPoint(at: Corner, { targets, reach, grid }: Near, from?: From): Snapped {
  const found = targets.corners.reduce<Corner | null>((best, one) => (distance(one, at) < (best ? distance(best, at) : reach) ? one : best), null);
  if (found) return { at: found, guides: [{ kind: "corner", line: [found, found] }] };
  const lines = [...(from ? linesFrom(from) : []), ...linesOf(targets, at, reach)];
  const first = lineNear(lines, at, reach);
  if (!first) return { at: [gridded(at[0], grid), gridded(at[1], grid)], guides: [] };
  const others = lines.filter((line) => {
    const both = crossing(first, line);
    return both !== null && distance(both, at) < reach * 1.5;
  });
  const second = lineNear(others, at, reach);
  const both = second && crossing(first, second);
  const guide = (line: Line, to: Corner): Guide => ({ kind: line.kind, line: [line.shown, to] });
  if (second && both) return { at: both, guides: [guide(first, both), guide(second, both)] };
  const on = alongGrid(first, foot(first, at), grid);
  return { at: on, guides: [guide(first, on)] };
}

/** Along a line only lengths come to lie on the grid; along the axes, places. */
function alongGrid(line: Line, on: Corner, grid: number): Corner {
  if (line.isMeasured) {
    const length = (on[0] - line.through[0]) * line.along[0] + (on[1] - line.through[1]) * line.along[1];
    const round = gridded(length, grid);
    return [line.through[0] + line.along[0] * round, line.through[1] + line.along[1] * round];
  }
  if (Math.abs(line.along[1]) < 1e-9) return [gridded(on[0], grid), on[1]];
  if (Math.abs(line.along[0]) < 1e-9) return [on[0], gridded(on[1], grid)];
  return on;
}

/** By how much an outline is moved that was dragged by so much: its corners meet others, its edges theirs. */
export function snapMove(outline: Outline, by: Corner, { targets, reach, grid }: Near): { by: Corner; guides: readonly Guide[] } {
  const moved = outline.map(([x, y]): Corner => [x + by[0], y + by[1]]);
  let best: { off: Corner; guides: Guide[] } | null = null;
  let least = reach;
  for (const at of moved) {
    for (const to of targets.corners) {
      const apart = distance(at, to);
      if (apart < least) [best, least] = [{ off: [to[0] - at[0], to[1] - at[1]], guides: [{ kind: "corner", line: [to, to] }] }, apart];
    }
  }
  best ??= alignment(moved, targets, reach);
  if (best) return { by: [by[0] + best.off[0], by[1] + best.off[1]], guides: best.guides };
  const [anchor] = outline;
  if (!anchor || grid <= 0) return { by, guides: [] };
  return { by: [gridded(anchor[0] + by[0], grid) - anchor[0], gridded(anchor[1] + by[1], grid) - anchor[1]], guides: [] };
}

/** How an outline comes to touch an edge, or to be level with corners along one axis or both. */
function alignment(moved: Outline, { corners, edges: all }: Targets, reach: number): { off: Corner; guides: Guide[] } | null {
  let touch: { off: Corner; guides: Guide[] } | null = null;
  let least = reach;
  for (const at of moved) {
    for (const edge of all) {
      const { at: on } = nearest(at, edge);
      const apart = distance(at, on);
      if (apart < least) [touch, least] = [{ off: [on[0] - at[0], on[1] - at[1]], guides: [{ kind: "edge", line: edge }] }, apart];
    }
  }
  if (touch) return touch;
  const axis = (of: 0 | 1) => {
    let found: { off: number; guide: Guide } | null = null;
    let nearby = reach;
    for (const at of moved) {
      for (const to of corners) {
        const apart = Math.abs(to[of] - at[of]);
        if (apart >= nearby) continue;
        const here: Corner = of === 0 ? [to[0], at[1]] : [at[0], to[1]];
        [found, nearby] = [{ off: to[of] - at[of], guide: { kind: "line", line: [to, here] } }, apart];
      }
    }
    return found;
  };
  const [x, y] = [axis(0), axis(1)];
  if (!x && !y) return null;
  return { off: [x?.off ?? 0, y?.off ?? 0], guides: [x, y].flatMap((one) => (one ? [one.guide] : [])) };
}

/** The turns that things have, and edges of outlines, as turns within a right angle. */
export function turnsOf(document: SceneDocument, except: ReadonlySet<string>): number[] {
  return things(document).filter(({ of }) => !except.has(of.id)).flatMap((one) => {
    const yaw = yawOf(one);
    if (yaw !== null) return [yaw];
    if (one.list !== "footprints") return [];
    return edges(one.of.polygon.map(corner)).map(([a, b]) => Math.atan2(b[1] - a[1], b[0] - a[0]) / DEGREE);
  });
}

/** A turn, square to or along with others that are near, or in steps. */
export function snapTurn(degrees: number, others: readonly number[]): number {
  const off = (other: number) => {
    const rest = (((degrees - other) % 90) + 90) % 90;
    return rest > 45 ? rest - 90 : rest;
  };
  const found = others.reduce<number | null>((best, one) => (Math.abs(off(one)) < (best === null ? TURN_REACH_DEG : Math.abs(best)) ? off(one) : best), null);
  return found === null ? Math.round(degrees / TURN_STEP_DEG) * TURN_STEP_DEG : degrees - found;
}

/** A height: level with others, or on the grid. */
export function snapHeight(height: number, others: readonly number[], { reach, grid }: Pick<Near, "reach" | "grid">): number {
  const found = others.reduce<number | null>((best, one) => (Math.abs(one - height) < (best === null ? reach : Math.abs(best - height)) ? one : best), null);
  return found ?? gridded(height, grid);
}

export const NOTHING_NEAR: Near = { targets: NO_TARGETS, reach: 0, grid: 0 };
