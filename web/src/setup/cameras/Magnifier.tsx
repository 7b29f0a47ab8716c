// A round glass beside the pointer that shows what lies beneath it, pixel by pixel.

import type { Frame, Pane } from "./frame";
import { resolved, toScreen } from "./frame";
import type { Pixel } from "./pairs";

const SIZE = 132;
const AWAY = 28;
/** Times that the glass enlarges what the pane shows, and the least size of a pixel in it. */
const TIMES = 5;
const LEAST_SCALE = 6;
/** From here on the pane itself shows pixels well enough. */
const ENOUGH = 14;

export function Magnifier({ url, frame, pane, at, isTouch }: { url: string; frame: Frame; pane: Pane; at: Pixel; isTouch: boolean }) {
  const { scale } = resolved(frame, pane);
  if (scale >= ENOUGH) return null;
  const own = Math.max(LEAST_SCALE, scale * TIMES);
  const [x, y] = toScreen(frame, pane, at);
  // Above a finger, which hides what is below it; else to the lower right, and where there is no room on the other side.
  const left = x + AWAY + SIZE > pane.screen[0] ? x - AWAY - SIZE : x + AWAY;
  const top = isTouch ? Math.max(y - AWAY * 2 - SIZE, 0) : y + AWAY + SIZE > pane.screen[1] ? y - AWAY - SIZE : y + AWAY;
  const place = `translate(${SIZE / 2 - at[0] * own}px, ${SIZE / 2 - at[1] * own}px)`;
  return (
    <div class="cal-magnifier" aria-hidden="true" style={{ left: `${left}px`, top: `${top}px`, width: `${SIZE}px`, height: `${SIZE}px` }}>
      <img alt="" src={url} style={{ width: `${pane.picture[0] * own}px`, height: `${pane.picture[1] * own}px`, transform: place }} />
      <svg width={SIZE} height={SIZE}>
        <path class="cal-crosshair" d={`M0 ${SIZE / 2}H${SIZE / 2 - own / 2}M${SIZE / 2 + own / 2} ${SIZE / 2}H${SIZE}M${SIZE / 2} 0V${SIZE / 2 - own / 2}M${SIZE / 2} ${SIZE / 2 + own / 2}V${SIZE}`} />
      </svg>
    </div>
  );
}
