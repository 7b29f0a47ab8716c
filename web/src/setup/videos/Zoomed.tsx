// A picture that can be enlarged at a place: by wheel, pointer and keys.

import { useRef, useState } from "preact/hooks";
import { say } from "../../strings";

const MOST = 8;
const STEP = 1.25;
const PAN = 0.1;

type Place = { readonly factor: number; readonly x: number; readonly y: number };

const WHOLE: Place = { factor: 1, x: 0, y: 0 };

/** Keeps the picture's edges outside the window's; x and y are the picture's corner in window widths and heights, 0 or less. */
function kept({ factor, x, y }: Place): Place {
  const low = 1 - factor;
  return { factor, x: Math.min(0, Math.max(low, x)), y: Math.min(0, Math.max(low, y)) };
}

/** Enlarged so that what lies at (u, v) of the window stays there. */
export function zoomed(before: Place, by: number, u: number, v: number): Place {
  const factor = Math.min(MOST, Math.max(1, before.factor * by));
  const ratio = factor / before.factor;
  return kept({ factor, x: u - (u - before.x) * ratio, y: v - (v - before.y) * ratio });
}

export function Zoomed({ name, url, alt, size }: { name: string; url: string | null; alt: string; size: readonly number[] | null }) {
  const [place, setPlace] = useState<Place>(WHOLE);
  const held = useRef<{ x: number; y: number } | null>(null);
  const pan = (x: number, y: number) => setPlace((before) => kept({ ...before, x: before.x + x, y: before.y + y }));
  const onKeyDown = (event: KeyboardEvent) => {
    const acts: Record<string, () => void> = {
      "+": () => setPlace((before) => zoomed(before, STEP, 0.5, 0.5)),
      "=": () => setPlace((before) => zoomed(before, STEP, 0.5, 0.5)),
      "-": () => setPlace((before) => zoomed(before, 1 / STEP, 0.5, 0.5)),
      "0": () => setPlace(WHOLE),
      ArrowLeft: () => pan(PAN, 0), ArrowRight: () => pan(-PAN, 0), ArrowUp: () => pan(0, PAN), ArrowDown: () => pan(0, -PAN),
    };
    const act = event.ctrlKey || event.metaKey ? undefined : acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  };
  const [width = 16, height = 9] = size ?? [];
  const style = { transformOrigin: "0 0", transform: `translate(${place.x * 100}%, ${place.y * 100}%) scale(${place.factor})` };
  return (
    // eslint-disable-next-line jsx-a11y/no-noninteractive-element-interactions -- it is worked as a map is
    <div class="zoomed look" role="application" aria-label={say("sync.zoom", { name })} tabIndex={0} // eslint-disable-line jsx-a11y/no-noninteractive-tabindex
      style={{ aspectRatio: `${width} / ${height}` }} onKeyDown={onKeyDown}
      onWheel={(event) => {
        event.preventDefault();
        const box = event.currentTarget.getBoundingClientRect();
        const [u, v] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
        setPlace((before) => zoomed(before, event.deltaY < 0 ? STEP : 1 / STEP, u, v));
      }}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        held.current = { x: event.clientX, y: event.clientY };
      }}
      onPointerMove={(event) => {
        if (!held.current) return;
        const box = event.currentTarget.getBoundingClientRect();
        pan((event.clientX - held.current.x) / box.width, (event.clientY - held.current.y) / box.height);
        held.current = { x: event.clientX, y: event.clientY };
      }}
      onPointerUp={() => { held.current = null; }} onPointerCancel={() => { held.current = null; }}>
      {url === null ? <p>{say("videos.look.asking")}</p> : <img src={url} alt={alt} style={style} draggable={false} />}
      {place.factor > 1 && <span class="stamp">{say("sync.zoomed", { factor: place.factor.toFixed(1) })}</span>}
    </div>
  );
}
