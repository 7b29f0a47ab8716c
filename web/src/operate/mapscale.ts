// The map's arithmetic: north up, so many metres across, pixels from the top left.

export type MapPlace = { readonly center: readonly [number, number]; readonly across: number };
export type Size = readonly [width: number, height: number];
type Spot = readonly [number, number];

export const LEAST_ACROSS_M = 2;
export const MOST_ACROSS_M = 50_000;
const BESIDE = 1.12;

/** All of it, with a little beside. */
export function whole({ low, high }: { low: Spot; high: Spot }, [width, height]: Size): MapPlace {
  const [wide, tall] = [high[0] - low[0], high[1] - low[1]];
  const across = Math.max(wide, (tall * width) / Math.max(height, 1), LEAST_ACROSS_M) * BESIDE;
  return { center: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], across };
}

export function toPixel({ center, across }: MapPlace, [width, height]: Size, [x, y]: readonly [number, number, ...number[]]): Spot {
  const scale = width / across;
  return [width / 2 + (x - center[0]) * scale, height / 2 - (y - center[1]) * scale];
}

export function toWorld({ center, across }: MapPlace, [width, height]: Size, [px, py]: Spot): Spot {
  const scale = across / width;
  return [center[0] + (px - width / 2) * scale, center[1] - (py - height / 2) * scale];
}

/** Zoomed so that what is under a pixel stays there; above 1 shows more. */
export function zoomedAt(place: MapPlace, size: Size, pixel: Spot, factor: number): MapPlace {
  const across = Math.min(Math.max(place.across * factor, LEAST_ACROSS_M), MOST_ACROSS_M);
  const [x, y] = toWorld(place, size, pixel);
  const share = across / place.across;
  return { across, center: [x + (place.center[0] - x) * share, y + (place.center[1] - y) * share] };
}

/** Moved by pixels. */
export function panned({ center, across }: MapPlace, [width]: Size, dx: number, dy: number): MapPlace {
  const scale = across / width;
  return { across, center: [center[0] - dx * scale, center[1] + dy * scale] };
}
