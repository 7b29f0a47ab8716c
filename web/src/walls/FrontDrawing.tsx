// The wall as one stands before it, with what it will show. Tiles that stand freely are dragged here, or moved by arrow keys.

import { useRef } from "preact/hooks";
import type { Point } from "../operate/orbit";
import { say } from "../strings";
import type { Faults } from "./validity";
import { type Wall, planeOf } from "./document";
import { arrow, dragging } from "./drag";
import { type Tile, bounds, fourth, frontOf, minus } from "./layout";
import { type Preview, WHOLE } from "./preview";
import { shifted, snapped } from "./placing";

const SNAP_M = 0.02;

type Given = {
  wall: Wall;
  preview: Preview;
  faults: Faults;
  chosen: number;
  canDrag: boolean;
  onChoose: (idx: number) => void;
  onMove: (idx: number, tile: Tile) => void;
  onEnd: () => void;
};

const shiftedBy = (tile: Tile, tiles: readonly Tile[], by: Point) => {
  const others = tiles.filter((other) => other.id !== tile.id);
  return shifted(tile, snapped(tile, others, by, SNAP_M));
};

/** From a tile's unit square, downwards, to the drawing: metres with y down. */
function matrixOf({ corners: [lowerLeft, lowerRight, upperLeft] }: Tile): string {
  const [across, down] = [minus(lowerRight, lowerLeft), minus(lowerLeft, upperLeft)];
  return `matrix(${[across[0], -across[1], down[0], -down[1], upperLeft[0], -upperLeft[1]].map((value) => value.toFixed(5)).join(" ")})`;
}

/** Where it fades out, of its unit square. */
function Fading({ tile: { blend_px: [left, right, top, bottom], size_px: [width, height] } }: { tile: Tile }) {
  const strips = [[0, 0, left / width, 1], [1 - right / width, 0, right / width, 1], [0, 0, 1, top / height], [0, 1 - bottom / height, 1, bottom / height]];
  return <>{strips.map(([x = 0, y = 0, w = 0, h = 0], i) => w > 0 && h > 0 && <rect key={i} class="fading" x={x} y={y} width={w} height={h} />)}</>;
}

export function FrontDrawing({ wall, preview, faults, chosen, canDrag, onChoose, onMove, onEnd }: Given) {
  const { surface } = wall;
  const tiles = frontOf(surface);
  const { low, high } = bounds(tiles);
  const [width, height] = [Math.max(high[0] - low[0], 0.1), Math.max(high[1] - low[1], 0.1)];
  const margin = 0.04 * Math.max(width, height);
  const box = [low[0] - margin, -high[1] - margin, width + 2 * margin, height + 2 * margin];
  const whole = preview.pictures.get(WHOLE);
  const plane = planeOf(surface);
  const isFree = surface.kind === "tiles" && canDrag;
  const taken = useRef<readonly Tile[]>(tiles);
  const middle = (tile: Tile) => {
    const [a, b] = [tile.corners[0], fourth(tile.corners)];
    return [(a[0] + b[0]) / 2, -(a[1] + b[1]) / 2] as const;
  };
  return (
    <svg class="drawing is-front" viewBox={box.map((value) => value.toFixed(4)).join(" ")} role="group" aria-label={say("wall.front")}>
      {whole !== undefined && plane && (
        <>
          <clipPath id="wall-tiles">{tiles.map((tile) => <rect key={tile.id} width={1} height={1} transform={matrixOf(tile)} />)}</clipPath>
          <image href={whole} x={low[0]} y={-high[1]} width={width} height={height} preserveAspectRatio="none" clip-path="url(#wall-tiles)" />
        </>
      )}
      {tiles.map((tile, i) => {
        const own = whole === undefined || !plane ? preview.pictures.get(tile.id) : undefined;
        const [x, y] = middle(tile);
        const letter = Math.min(Math.hypot(...minus(tile.corners[1], tile.corners[0])) / 6, 0.12 * Math.max(width, height));
        const isWrong = [...faults.keys()].some((pointer) => pointer === `/surface/tiles/${i}` || pointer.startsWith(`/surface/tiles/${i}/`));
        const content = (
          <>
            <g transform={matrixOf(tile)}>
              {own !== undefined && <image href={own} width={1} height={1} preserveAspectRatio="none" />}
              <Fading tile={tile} />
              <rect class="edge" width={1} height={1} vector-effect="non-scaling-stroke" />
            </g>
            <text x={x} y={y} font-size={letter} dominant-baseline="central" text-anchor="middle">{tile.id}</text>
          </>
        );
        const look = `tile${isWrong ? " is-wrong" : ""}${isFree && i === chosen ? " is-chosen" : ""}`;
        if (!isFree) return <g key={tile.id} class={look}>{content}</g>;
        return (
          <g key={i} class={`${look} is-free`} role="button" tabIndex={0} aria-pressed={i === chosen}
            aria-label={say("wall.tile.place", { tile: tile.id, x: x.toFixed(2), y: (-y).toFixed(2) })}
            onFocus={() => onChoose(i)}
            onKeyDown={(event) => {
              const by = arrow(event);
              if (by) onMove(i, shifted(tile, [by[0], by[1], 0]));
            }}
            {...dragging(
              ([right, down]) => onMove(i, shiftedBy(taken.current[i] ?? tile, taken.current, [right, -down, 0])),
              onEnd,
              () => {
                taken.current = tiles;
                onChoose(i);
              },
            )}>
            {content}
          </g>
        );
      })}
    </svg>
  );
}
