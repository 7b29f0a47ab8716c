// Which part of a picture a pane shows: zoom and pan as plain functions. Picture points in pixels from the picture's upper left
// corner, screen points in CSS pixels from the pane's.

import type { Pixel } from "./pairs";

/** `at` stands in the pane's middle, one picture pixel is `scale` screen pixels large; null shows the whole picture. */
export type Frame = { readonly at: Pixel; readonly scale: number } | null;
export type Pane = { readonly picture: Pixel; readonly screen: Pixel };

const LARGEST_SCALE = 40;
/** Picture pixels this large are shown as squares. */
export const SQUARES_FROM = 3;

/** Screen pixels a picture pixel takes when the whole picture is shown. */
export function whole({ picture, screen }: Pane): number {
  return Math.min(screen[0] / picture[0], screen[1] / picture[1]) || 1;
}

/** What is shown where nothing was chosen. */
export function resolved(frame: Frame, pane: Pane): { at: Pixel; scale: number } {
  return frame ?? { at: [pane.picture[0] / 2, pane.picture[1] / 2], scale: whole(pane) };
}

export function toScreen(frame: Frame, pane: Pane, [x, y]: Pixel): Pixel {
  const { at, scale } = resolved(frame, pane);
  return [(x - at[0]) * scale + pane.screen[0] / 2, (y - at[1]) * scale + pane.screen[1] / 2];
}

export function toPicture(frame: Frame, pane: Pane, [x, y]: Pixel): Pixel {
  const { at, scale } = resolved(frame, pane);
  return [(x - pane.screen[0] / 2) / scale + at[0], (y - pane.screen[1] / 2) / scale + at[1]];
}

const clamp = (value: number, low: number, high: number) => Math.min(Math.max(value, low), high);

/** No pane shows nothing but what lies beside the picture; and a picture that fits whole is shown whole. */
function held(frame: { at: Pixel; scale: number }, pane: Pane): Frame {
  const smallest = whole(pane);
  const scale = Math.min(frame.scale, Math.max(LARGEST_SCALE, smallest));
  if (scale <= smallest * 1.0001) return null;
  return { at: [clamp(frame.at[0], 0, pane.picture[0]), clamp(frame.at[1], 0, pane.picture[1])], scale };
}

/** Comes closer by a factor; what lies beneath a point of the screen stays there. */
export function zoomed(frame: Frame, pane: Pane, factor: number, under: Pixel = [pane.screen[0] / 2, pane.screen[1] / 2]): Frame {
  const held_ = toPicture(frame, pane, under);
  const scale = clamp(resolved(frame, pane).scale * factor, whole(pane), Math.max(LARGEST_SCALE, whole(pane)));
  const [dx, dy] = [under[0] - pane.screen[0] / 2, under[1] - pane.screen[1] / 2];
  return held({ at: [held_[0] - dx / scale, held_[1] - dy / scale], scale }, pane);
}

/** Moves the picture by so many pixels of the screen. */
export function panned(frame: Frame, pane: Pane, [dx, dy]: Pixel): Frame {
  const { at, scale } = resolved(frame, pane);
  return held({ at: [at[0] - dx / scale, at[1] - dy / scale], scale }, pane);
}

/** Shows a point of the picture, if it lies beside the pane or at its very edge. */
export function showing(frame: Frame, pane: Pane, point: Pixel, margin = 24): Frame {
  const [x, y] = toScreen(frame, pane, point);
  const beside = (at: number, size: number) => Math.min(at - margin, 0) + Math.max(at - (size - margin), 0);
  const [dx, dy] = [beside(x, pane.screen[0]), beside(y, pane.screen[1])];
  return frame && (dx !== 0 || dy !== 0) ? panned(frame, pane, [-dx, -dy]) : frame;
}
