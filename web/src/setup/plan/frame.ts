// The map from above: which part of the world it shows. East is to the right, north is up.

export type Corner = readonly [number, number];
export type Bounds = { readonly low: Corner; readonly high: Corner };
/** `scale`: pixels a metre. */
export type Frame = { readonly center: Corner; readonly scale: number; readonly size_px: Corner };

const SCALES = [1e-3, 5e3] as const;
/** What an empty world shows, metres across. */
const EMPTY_M = 40;
/** Room around what is fitted, share of the map. */
const MARGIN = 0.08;
/** Lines of the grid are at least so far apart. */
const CLOSEST_LINES_PX = 24;

const clamped = (scale: number) => Math.min(Math.max(scale, SCALES[0]), SCALES[1]);

export function toScreen({ center, scale, size_px }: Frame, [x, y]: Corner): Corner {
  return [size_px[0] / 2 + (x - center[0]) * scale, size_px[1] / 2 - (y - center[1]) * scale];
}

export function toWorld({ center, scale, size_px }: Frame, [px, py]: Corner): Corner {
  return [center[0] + (px - size_px[0] / 2) / scale, center[1] - (py - size_px[1] / 2) / scale];
}

/** The map moved by pixels, as if it was dragged. */
export function panned(frame: Frame, [dx, dy]: Corner): Frame {
  return { ...frame, center: [frame.center[0] - dx / frame.scale, frame.center[1] + dy / frame.scale] };
}

/** The map enlarged `factor` times; what lies under `at` stays there. */
export function zoomed(frame: Frame, factor: number, at: Corner): Frame {
  const held = toWorld(frame, at);
  const scale = clamped(frame.scale * factor);
  const off = toWorld({ ...frame, scale }, at);
  return { ...frame, scale, center: [frame.center[0] + held[0] - off[0], frame.center[1] + held[1] - off[1]] };
}

/** The extent of places; null of none. */
export function boundsOf(places: readonly (readonly number[])[]): Bounds | null {
  if (places.length === 0) return null;
  const all = (axis: 0 | 1) => places.map((place) => place[axis] ?? 0);
  return { low: [Math.min(...all(0)), Math.min(...all(1))], high: [Math.max(...all(0)), Math.max(...all(1))] };
}

/** The map that shows all of it. */
export function fitted(bounds: Bounds | null, size_px: Corner): Frame {
  const { low, high } = bounds ?? { low: [-EMPTY_M / 2, -EMPTY_M / 2], high: [EMPTY_M / 2, EMPTY_M / 2] };
  const room = 1 - 2 * MARGIN;
  const extent = (axis: 0 | 1) => Math.max(high[axis] - low[axis], 1e-3);
  const scale = clamped(Math.min((size_px[0] * room) / extent(0), (size_px[1] * room) / extent(1)));
  return { center: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], scale, size_px };
}

/** Of 1, 2 and 5 times powers of ten the least that is at least this. */
export function roundStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * ([1, 2, 5, 10].find((n) => n * power >= least * (1 - 1e-9)) ?? 10);
}

/** Lines of a grid of `step` metres, or of a coarser one where that would be too dense, along one axis. */
export function gridLines(frame: Frame, axis: 0 | 1, step = 0): number[] {
  const apart = Math.max(step, roundStep(CLOSEST_LINES_PX / frame.scale));
  const half = frame.size_px[axis] / 2 / frame.scale;
  const [first, last] = [Math.ceil((frame.center[axis] - half) / apart), Math.floor((frame.center[axis] + half) / apart)];
  return Array.from({ length: Math.max(last - first + 1, 0) }, (_, i) => (first + i) * apart);
}
