// Drawing as a machine of few states: first an outline on the ground, by dragging or by clicks, then its height. What it takes are
// places that are snapped already; what it answers is the next state.

import type { Corner } from "../../plan/frame";
import { type Outline, distance, doCross, edges, firstCrossing, strip, turned } from "../outline";
import { circle } from "../things";

export const DRAWN = ["box", "cylinder", "wall", "footprint"] as const;
export type Drawn = (typeof DRAWN)[number];
export type DrawFault = "crossing" | "small" | "few";

export type Drawing = {
  readonly tool: Drawn;
  readonly stage: "outline" | "height";
  /** Corners that are set: two of a box (opposite) and a cylinder (middle and rim), the line of a wall, the outline of a footprint. */
  readonly corners: readonly Corner[];
  /** Where the next corner would be. */
  readonly pointer: Corner;
  /** The height on which it stands. */
  readonly base: number;
  readonly height: number;
  /** Of walls. */
  readonly thickness: number;
  /** The turn of a box: that of the edge on which it was begun. */
  readonly yaw: number;
  /** Why the last step was not taken. */
  readonly fault: DrawFault | null;
};

/** What is smaller is a slip of the hand. */
const SMALLEST_M = 0.05;

/** Two corners and no more. */
const isPaired = (tool: Drawn) => tool === "box" || tool === "cylinder";

export function begin(tool: Drawn, at: Corner, base: number, given: { height: number; thickness: number; yaw?: number }): Drawing {
  return { tool, stage: "outline", corners: [at], pointer: at, base, height: given.height, thickness: given.thickness, yaw: given.yaw ?? 0, fault: null };
}

export function pointTo(of: Drawing, at: Corner): Drawing {
  return of.stage === "outline" ? { ...of, pointer: at } : of;
}

function isSmall({ tool, corners, yaw }: Drawing, at: Corner): boolean {
  const [first = at] = corners;
  if (tool !== "box") return distance(first, at) < SMALLEST_M;
  const [x, y] = turned(at, first, -yaw);
  return Math.abs(x - first[0]) < SMALLEST_M || Math.abs(y - first[1]) < SMALLEST_M;
}

/** Sets the next corner. A footprint closes on its first one. */
export function setCorner(of: Drawing, at: Corner, closeReach = SMALLEST_M): Drawing {
  if (of.stage !== "outline") return of;
  const { corners } = of;
  const [first, last] = [corners[0] ?? at, corners.at(-1) ?? at];
  if (isPaired(of.tool)) {
    return isSmall(of, at) ? { ...of, pointer: at, fault: "small" } : { ...of, corners: [first, at], pointer: at, stage: "height", fault: null };
  }
  if (of.tool === "footprint" && corners.length > 2 && distance(at, first) < closeReach) return close(of);
  if (distance(at, last) < SMALLEST_M) return { ...of, fault: null };
  const edge = [last, at] as const;
  const before = edges(corners).slice(0, -1);
  if (of.tool === "footprint" && before.some((one) => doCross(one, edge))) return { ...of, pointer: at, fault: "crossing" };
  return { ...of, corners: [...corners, at], pointer: at, fault: null };
}

/** Ends the outline of a wall or a footprint. */
export function close(of: Drawing): Drawing {
  if (of.stage !== "outline") return of;
  if (isPaired(of.tool)) return setCorner(of, of.pointer);
  if (of.corners.length < (of.tool === "footprint" ? 3 : 2)) return { ...of, fault: "few" };
  if (firstCrossing(outlineOf({ ...of, stage: "height" }))) return { ...of, fault: "crossing" };
  return { ...of, stage: "height", fault: null };
}

/** Takes the last corner back, or the end of the outline; null where nothing is left. */
export function back(of: Drawing): Drawing | null {
  if (of.stage === "height") return { ...of, stage: "outline", corners: isPaired(of.tool) ? of.corners.slice(0, 1) : of.corners, fault: null };
  return of.corners.length > 1 ? { ...of, corners: of.corners.slice(0, -1), fault: null } : null;
}

export function withHeight(of: Drawing, height: number): Drawing {
  return { ...of, height };
}

/** A rectangle of opposite corners, turned. */
function between(a: Corner, b: Corner, yaw: number): Corner[] {
  const [x, y] = turned(b, a, -yaw);
  return ([a, [x, a[1]], [x, y], [a[0], y]] as Corner[]).map((at) => turned(at, a, yaw));
}

/** The outline as it stands, with the next corner where the pointer is. */
export function outlineOf(of: Drawing): Outline {
  const [first = of.pointer, second = of.pointer] = of.corners;
  const line = of.stage === "outline" ? [...of.corners, of.pointer] : of.corners;
  switch (of.tool) {
    case "box":
      return between(first, second, of.yaw);
    case "cylinder":
      return circle(first, distance(first, second));
    case "wall":
      return strip(line.filter((at, i) => i === 0 || distance(at, line[i - 1] ?? at) > 1e-9), of.thickness);
    case "footprint":
      return line;
  }
}
