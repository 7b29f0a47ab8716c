// What a calibration draws into its camera's picture, so that one sees at once whether it fits: the horizon, a grid on the ground,
// and the edges of what stands there. As paths of SVG in the picture's pixels.

import type { Point } from "../../operate/orbit";
import type { Lens } from "../../spatial/lens";
import type { SceneDocument } from "../draft";
import { type Pixel, pixelOf } from "./pairs";
import { edges, step } from "./snaps";
import { add, extent, length, minus } from "./torch";

const FAR_M = 1e7;
const HORIZON_STEP_DEG = 0.5;
/** A line is drawn this far beside the picture, in its sizes: what is farther is no use, and large numbers are slow to draw. */
const BESIDE = 0.5;
const MOST_LINES = 60;
const PIECES = 48;

function isNear([x, y]: Pixel, { size: [width, height] }: Lens): boolean {
  return x > -BESIDE * width && x < (1 + BESIDE) * width && y > -BESIDE * height && y < (1 + BESIDE) * height;
}

const print = ([x, y]: Pixel) => `${x.toFixed(2)} ${y.toFixed(2)}`;

/** A path through places, broken where the picture does not show them. */
function path(lens: Lens, places: readonly Point[]): string {
  let text = "";
  let isBroken = true;
  let before: Pixel | null = null;
  for (const place of places) {
    const at = pixelOf(lens, place);
    const isShown = at !== null && isNear(at, lens);
    if (isShown && isBroken) text += before ? `M${print(before)}L${print(at)}` : `M${print(at)}`;
    // The first point beside the picture still ends the line that leaves it.
    else if (at && !isBroken) text += `L${print(at)}`;
    isBroken = !isShown;
    before = at;
  }
  return text;
}

/** The horizon, as far as the lens shows it. */
export function horizon(lens: Lens): string {
  const [, , [fx, fy]] = lens.axes;
  // Begun behind the camera, so that the path is not cut in its midst.
  const first = Math.atan2(fy, fx) + Math.PI;
  const n = Math.round(360 / HORIZON_STEP_DEG);
  return path(lens, Array.from({ length: n + 1 }, (_, i) => {
    const turn = first + (2 * Math.PI * i) / n;
    return add(lens.position, [Math.cos(turn), Math.sin(turn), 0], FAR_M);
  }));
}

/** A line in the world in pieces that a bent lens may bend; finer near the camera, where they are large in the picture. */
function pieces(lens: Lens, a: Point, b: Point): Point[] {
  const along = minus(b, a);
  const reach = length(along);
  const nearest = reach === 0 ? 0 : Math.min(Math.max(dotted(minus(lens.position, a), along) / reach ** 2, 0), 1);
  const shares = Array.from({ length: PIECES + 1 }, (_, i) => {
    const t = (2 * i) / PIECES - 1;
    return t < 0 ? nearest * (1 - t * t) : nearest + (1 - nearest) * t * t;
  });
  return shares.map((share) => add(a, along, share));
}

const dotted = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The distance of the grid's lines: round, and not too many. */
export function gridStep(document: SceneDocument): number {
  const { low, high } = extent(document);
  return step(Math.max(high[0] - low[0], high[1] - low[1]) / MOST_LINES);
}

/** A grid on the ground: thin lines at every step, thick ones at every fifth. */
export function grid(lens: Lens, document: SceneDocument): { thin: string; thick: string } {
  const { low, high, level_m } = extent(document);
  const every = gridStep(document);
  const drawn = { thin: "", thick: "" };
  for (const axis of [0, 1] as const) {
    const other = axis === 0 ? 1 : 0;
    for (let i = Math.ceil(low[axis] / every); i * every <= high[axis]; i += 1) {
      const end = (along: number): Point => (axis === 0 ? [i * every, along, level_m] : [along, i * every, level_m]);
      drawn[i % 5 === 0 ? "thick" : "thin"] += path(lens, pieces(lens, end(low[other]), end(high[other])));
    }
  }
  return drawn;
}

/** The edges of ground and buildings. */
export function outline(lens: Lens, document: SceneDocument): string {
  return edges(document).map(({ ends: [a, b] }) => path(lens, pieces(lens, a, b))).join("");
}
