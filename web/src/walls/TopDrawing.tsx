// The wall from above: its curve, and where the viewer stands. The viewer is dragged here, a cylinder by its radius, and tiles that
// stand freely; by arrow keys too.

import { useRef } from "preact/hooks";
import type { Point } from "../operate/orbit";
import { say } from "../strings";
import { type Wall, viewerOf } from "./document";
import { arrow, dragging } from "./drag";
import { type Surface, type Tile, bounds, fourth, tilesOf } from "./layout";
import { shifted } from "./placing";

type Given = {
  wall: Wall;
  chosen: number;
  canDrag: boolean;
  onChoose: (idx: number) => void;
  onMove: (idx: number, tile: Tile) => void;
  onViewer: (viewer: Point) => void;
  onRadius: (radius: number) => void;
  onEnd: () => void;
};

const rounded = (metres: number) => Math.round(metres * 1e3) / 1e3;

/** How wide the wall is before the viewer, degrees. */
function spanOf(tiles: readonly Tile[], [x, , z]: Point): number {
  const angles = tiles.flatMap(({ corners }) => [...corners, fourth(corners)]).map((corner) => Math.atan2(corner[0] - x, z - corner[2]));
  return angles.length > 0 ? ((Math.max(...angles) - Math.min(...angles)) * 180) / Math.PI : 0;
}

function Radius({ surface, canDrag, size, onRadius, onEnd }: {
  surface: Surface & { kind: "cylinder" }; canDrag: boolean; size: number; onRadius: (radius: number) => void; onEnd: () => void;
}) {
  const { radius_m: radius } = surface;
  return (
    <>
      <circle class="curve" cx={0} cy={0} r={radius} vector-effect="non-scaling-stroke" />
      {canDrag && (
        <circle class="radius-handle" cx={0} cy={-radius} r={size} role="slider" tabIndex={0} aria-label={say("wall.radius")}
          aria-valuenow={radius} aria-valuetext={say("wall.metres", { n: radius })} aria-orientation="vertical"
          onKeyDown={(event) => {
            const by = arrow(event);
            if (by) onRadius(rounded(radius + by[0] + by[1]));
          }}
          {...dragging((_, [, y]) => onRadius(rounded(Math.max(-y, 0.01))), onEnd)} />
      )}
    </>
  );
}

export function TopDrawing({ wall, chosen, canDrag, onChoose, onMove, onViewer, onRadius, onEnd }: Given) {
  const { surface } = wall;
  const tiles = tilesOf(surface);
  const viewer = viewerOf(wall);
  const { low, high } = bounds(tiles);
  const radius = surface.kind === "cylinder" ? surface.radius_m : 0;
  const [left, right] = [Math.min(low[0], viewer[0], -radius), Math.max(high[0], viewer[0], radius)];
  const [back, front] = [Math.min(low[2], viewer[2], -radius), Math.max(high[2], viewer[2], radius)];
  const extent = Math.max(right - left, front - back, 0.1);
  const margin = 0.08 * extent;
  const box = [left - margin, back - margin, right - left + 2 * margin, front - back + 2 * margin];
  const size = 0.025 * extent;
  const isFree = surface.kind === "tiles" && canDrag;
  const taken = useRef<readonly Tile[]>(tiles);
  const edges = [low[0], high[0]].map((x) => [x, (low[2] + high[2]) / 2] as const);
  const text = say("wall.viewer.place", { x: rounded(viewer[0]), z: rounded(viewer[2]), span: Math.round(spanOf(tiles, viewer)) });
  const moveViewer = (dx: number, dz: number, from: Point) => onViewer([rounded(from[0] + dx), from[1], rounded(from[2] + dz)]);
  const stood = useRef(viewer);
  return (
    <svg class="drawing is-top" viewBox={box.map((value) => value.toFixed(4)).join(" ")} role="group" aria-label={say("wall.top")}>
      {surface.kind !== "cylinder" && edges.map(([x, z], i) => <line key={i} class="sight" x1={viewer[0]} y1={viewer[2]} x2={x} y2={z} vector-effect="non-scaling-stroke" />)}
      {surface.kind === "cylinder" && <Radius surface={surface} canDrag={canDrag} size={size} onRadius={onRadius} onEnd={onEnd} />}
      {tiles.map((tile, i) => {
        const [a, b] = tile.corners;
        const line = <line class="tile-line" x1={a[0]} y1={a[2]} x2={b[0]} y2={b[2]} vector-effect="non-scaling-stroke" />;
        if (!isFree) return <g key={tile.id}>{line}</g>;
        return (
          <g key={i} class={i === chosen ? "is-free is-chosen" : "is-free"} role="button" tabIndex={0} aria-pressed={i === chosen}
            aria-label={say("wall.tile.depth", { tile: tile.id, x: rounded((a[0] + b[0]) / 2), z: rounded((a[2] + b[2]) / 2) })}
            onFocus={() => onChoose(i)}
            onKeyDown={(event) => {
              const by = arrow(event);
              if (by) onMove(i, shifted(tile, [by[0], 0, -by[1]]));
            }}
            {...dragging(([x, z]) => onMove(i, shifted(taken.current[i] ?? tile, [rounded(x), 0, rounded(z)])), onEnd, () => {
              taken.current = tiles;
              onChoose(i);
            })}>
            <line class="grip" x1={a[0]} y1={a[2]} x2={b[0]} y2={b[2]} stroke-width={2 * size} />
            {line}
          </g>
        );
      })}
      {canDrag ? (
        <circle class="viewer" cx={viewer[0]} cy={viewer[2]} r={size} role="button" tabIndex={0} aria-label={text}
          onKeyDown={(event) => {
            const by = arrow(event);
            if (by) moveViewer(by[0], -by[1], viewer);
          }}
          {...dragging(([x, z]) => moveViewer(x, z, stood.current), onEnd, () => (stood.current = viewer))} />
      ) : <circle class="viewer" cx={viewer[0]} cy={viewer[2]} r={size}><title>{text}</title></circle>}
    </svg>
  );
}
