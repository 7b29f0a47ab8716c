// Which cameras' pictures are worth projecting where there are more than fit: those that show most, most squarely and most the way
// the viewer looks, of the places that are seen.

import type { Point } from "../operate/orbit";
import { type Lens, isInside, project } from "./lens";

/** Most cameras whose pictures are projected at once. */
export const MOST_PROJECTED = 16;

const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const unit = (a: Point): Point => {
  const length = Math.hypot(...a) || 1;
  return [a[0] / length, a[1] / length, a[2] / length];
};
const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The weight of a camera's picture at a place, as the shader has it but for what hides: 0 where it sees nothing of it. */
export function weight(lens: Lens, place: Point, normal: Point, eye: Point): number {
  const seen = project(lens, place);
  if (!seen || !isInside(seen)) return 0;
  const toCamera = unit(minus(lens.position, place));
  const toViewer = unit(minus(eye, place));
  const cosine = dot(toCamera, normal);
  return cosine > 0.0087 ? (cosine * (dot(toCamera, toViewer) + 1)) ** 5 : 0;
}

/** The `most` useful of `cameras` for whoever stands at `eye` and sees `places`. Every place has one vote, shared among those that see
 * it, so that no corner is left out for the sake of another that is seen well anyway. */
export function mostUseful<Camera extends { readonly lens: Lens }>(
  cameras: readonly Camera[], eye: Point, places: readonly { point: Point; normal: Point }[], most = MOST_PROJECTED,
): Camera[] {
  if (cameras.length <= most) return [...cameras];
  const votes = new Map<Camera, number>(cameras.map((camera) => [camera, 0]));
  for (const { point, normal } of places) {
    const weights = cameras.map(({ lens }) => weight(lens, point, normal, eye));
    const sum = weights.reduce((total, one) => total + one, 0);
    if (sum > 0) cameras.forEach((camera, i) => votes.set(camera, (votes.get(camera) ?? 0) + (weights[i] ?? 0) / sum));
  }
  const target = places[0]?.point ?? eye;
  const distance = ({ lens }: Camera) => Math.hypot(...minus(lens.position, target));
  return [...cameras]
    .sort((a, b) => (votes.get(b) ?? 0) - (votes.get(a) ?? 0) || distance(a) - distance(b))
    .slice(0, most);
}
