// The numbers of a wall's tiles: a grid's, a cylinder's, or each free tile's own.

import { Segments } from "../parts/parts";
import { say } from "../strings";
import type { Faults } from "./validity";
import { type Wall, viewerOf } from "./document";
import { edit } from "./draft";
import { NumberField, NumbersField, TextField } from "./fields";
import { type Grid, type Kind, MOST_TILES, type Surface, type Tile, bounds, converted } from "./layout";
import { type Placing, cornersOf, placingOf } from "./placing";

const KINDS = ["grid", "cylinder", "tiles"] as const satisfies readonly Kind[];

const setSurface = (surface: Surface, key?: string) => edit((wall) => ({ ...wall, surface }), key);

function GridFields({ surface, faults }: { surface: Exclude<Surface, { kind: "tiles" }>; faults: Faults }) {
  const place = `/surface/${surface.kind}`;
  const set = (part: Partial<Grid & { radius_m: number }>) => setSurface({ ...surface, ...part }, `surface.${Object.keys(part).join()}`);
  const both = [say("wall.across"), say("wall.up")];
  return (
    <div class="entries">
      <NumberField label={say("wall.columns")} pointer={`${place}/columns`} faults={faults} value={surface.columns} isWhole step={1}
        onChange={(columns) => set({ columns })} />
      <NumberField label={say("wall.rows")} pointer={`${place}/rows`} faults={faults} value={surface.rows} isWhole step={1} onChange={(rows) => set({ rows })} />
      <NumbersField label={say("wall.tilePx")} pointer={`${place}/tile_px`} faults={faults} values={surface.tile_px} names={both} isWhole step={1} unit="px"
        onChange={(tile_px) => set({ tile_px })} />
      <NumbersField label={say("wall.tileM")} pointer={`${place}/tile_m`} faults={faults} values={surface.tile_m} names={both} step={0.01} unit="m"
        onChange={(tile_m) => set({ tile_m })} />
      <NumbersField label={say("wall.gap")} pointer={`${place}/gap_m`} faults={faults} values={surface.gap_m} names={both} step={0.001} unit="m"
        onChange={(gap_m) => set({ gap_m })} />
      {surface.kind === "cylinder" && (
        <NumberField label={say("wall.radius")} pointer={`${place}/radius_m`} faults={faults} value={surface.radius_m} step={0.01} unit="m"
          onChange={(radius_m) => set({ radius_m })} />
      )}
    </div>
  );
}

/** A name that no tile has. */
function freshId(tiles: readonly Tile[]): string {
  for (let n = tiles.length + 1; ; n += 1) {
    if (!tiles.some(({ id }) => id === `t${n}`)) return `t${n}`;
  }
}

/** Another tile like the chosen one, to the right of all. */
function withAnother(tiles: readonly Tile[], like: Tile | undefined): readonly Tile[] {
  const { high } = bounds(tiles);
  const from = like ?? tiles[0];
  const placing: Placing = from ? placingOf(from.corners) : { middle: [0, 0, 0], width: 1.21, height: 0.68, yaw: 0, pitch: 0, roll: 0 };
  const middle = [high[0] + placing.width / 2 + 0.01, placing.middle[1], placing.middle[2]] as const;
  return [...tiles, { id: freshId(tiles), size_px: from?.size_px ?? [1920, 1080], corners: cornersOf({ ...placing, middle }), blend_px: [0, 0, 0, 0] }];
}

function TileFields({ tile, place, faults, onChange }: { tile: Tile; place: string; faults: Faults; onChange: (tile: Tile, key: string) => void }) {
  const placing = placingOf(tile.corners);
  const stand = (part: Partial<Placing>) => onChange({ ...tile, corners: cornersOf({ ...placing, ...part }) }, Object.keys(part).join());
  return (
    <div class="entries">
      <TextField label={say("wall.tileId")} pointer={`${place}/id`} faults={faults} value={tile.id} onChange={(id) => onChange({ ...tile, id }, "id")} />
      <NumbersField label={say("wall.tilePx")} pointer={`${place}/size_px`} faults={faults} values={tile.size_px} names={[say("wall.across"), say("wall.up")]} isWhole
        step={1} unit="px" onChange={(size_px) => onChange({ ...tile, size_px }, "px")} />
      <NumbersField label={say("wall.middle")} pointer={`${place}/middle`} faults={faults} values={placing.middle} names={["x", "y", "z"]} step={0.01} unit="m"
        onChange={(middle) => stand({ middle })} />
      <NumbersField label={say("wall.tileM")} pointer={`${place}/size_m`} faults={faults} values={[placing.width, placing.height] as const}
        names={[say("wall.across"), say("wall.up")]} step={0.01} unit="m" onChange={([width, height]) => (width >= 0.001 && height >= 0.001 ? stand({ width, height }) : undefined)} />
      <NumbersField label={say("wall.turned")} pointer={`${place}/turned`} faults={faults} values={[placing.yaw, placing.pitch, placing.roll] as const}
        names={[say("wall.yaw"), say("wall.pitch"), say("wall.roll")]} step={1} unit="°" onChange={([yaw, pitch, roll]) => stand({ yaw, pitch, roll })} />
      <NumbersField label={say("wall.blend")} pointer={`${place}/blend_px`} faults={faults} values={tile.blend_px}
        names={[say("wall.left"), say("wall.right"), say("wall.top.edge"), say("wall.bottom")]} isWhole step={1} unit="px"
        onChange={(blend_px) => onChange({ ...tile, blend_px }, "blend")} />
    </div>
  );
}

function FreeFields({ surface, faults, chosen, onChoose }: {
  surface: Surface & { kind: "tiles" }; faults: Faults; chosen: number; onChoose: (idx: number) => void;
}) {
  const { tiles } = surface;
  const at = Math.min(chosen, tiles.length - 1);
  const tile = tiles[at];
  const whole = faults.get("/surface/tiles");
  return (
    <>
      {whole !== undefined && <p class="wrong" role="alert">{whole}</p>}
      <div class="choices">
        <label class="inline">
          {say("wall.tile.choose")}{" "}
          <select value={String(at)} onChange={(event) => onChoose(Number(event.currentTarget.value))}>
            {tiles.map(({ id }, i) => <option key={i} value={String(i)}>{id}</option>)}
          </select>
        </label>
        <button type="button" disabled={tiles.length >= MOST_TILES} onClick={() => {
          setSurface({ kind: "tiles", tiles: withAnother(tiles, tile) });
          onChoose(tiles.length);
        }}>{say("wall.tile.add")}</button>
        <button type="button" disabled={tiles.length <= 1} onClick={() => {
          setSurface({ kind: "tiles", tiles: tiles.filter((_, i) => i !== at) });
          onChoose(Math.max(at - 1, 0));
        }}>{say("wall.tile.remove")}</button>
      </div>
      {faults.get(`/surface/tiles/${at}`) !== undefined && <p class="wrong">{faults.get(`/surface/tiles/${at}`)}</p>}
      {tile && <TileFields key={at} tile={tile} place={`/surface/tiles/${at}`} faults={faults}
        onChange={(next, key) => setSurface({ kind: "tiles", tiles: tiles.map((old, i) => (i === at ? next : old)) }, `tile.${at}.${key}`)} />}
    </>
  );
}

/** The wall with its tiles as another kind; tiles that stood around the viewer go on to. */
function inKind(wall: Wall, kind: Kind): Wall {
  const viewer_m = wall.surface.kind === "cylinder" && kind === "tiles" ? viewerOf(wall) : null;
  return { ...wall, surface: converted(wall.surface, kind), viewer_m };
}

export function LayoutFields({ wall, faults, chosen, onChoose }: { wall: Wall; faults: Faults; chosen: number; onChoose: (idx: number) => void }) {
  const { surface } = wall;
  return (
    <section class="card" aria-label={say("wall.layout")}>
      <h2>{say("wall.layout")}</h2>
      <Segments name="wall-kind" label={say("wall.layout")} values={KINDS} chosen={surface.kind} text={(kind) => say(`wall.kind.${kind}`)}
        onChoose={(kind) => edit((of) => inKind(of, kind))} />
      <p class="quiet">{say(`wall.kind.${surface.kind}.help`)}</p>
      {surface.kind === "tiles"
        ? <FreeFields surface={surface} faults={faults} chosen={chosen} onChoose={onChoose} />
        : <GridFields surface={surface} faults={faults} />}
    </section>
  );
}
