// The picture that lies on an outline of the ground: which, and where, by a known length, the north, a hand or numbers.

import { useState } from "preact/hooks";
import { told } from "../../ask";
import { mapOf } from "../../spatial/planeMap";
import { say } from "../../strings";
import { keepFile } from "../assets";
import { draft, isReadOnly, settle } from "../draft";
import { NumberField, digits } from "../Fields";
import { atThing } from "../faults";
import { boundsOf, type Corner } from "../plan/frame";
import { useUrl } from "./GroundPicture";
import { type Imagery, applied, byLength, described, laidOut, movedImagery, residual, worldFromPixel } from "./placement";
import { PointFields } from "./PointFields";
import { without } from "../without";
import { onEarth } from "./earth";
import { rectangle, rounded } from "./polygon";
import { type Ground, addGround, editGround, editImagery, line, sizes, take, tool } from "./tools";

/** What the daemon takes. */
const MOST_BYTES = 64 * 2 ** 20;
const MOST_PIXELS = 8_192;
/** How wide a picture is laid out where nothing says it. */
const USUAL_WIDTH_M = 40;

async function sizeOf(file: File): Promise<Corner> {
  const image = await createImageBitmap(file).catch(() => null);
  if (!image) throw new Error(say("ground.picture.unread"));
  const size: Corner = [image.width, image.height];
  image.close();
  if (file.size > MOST_BYTES || Math.max(...size) > MOST_PIXELS) throw new Error(say("ground.picture.large"));
  return size;
}

/** Lays a picture out over an outline; over one of its own where there is none. Answers on which outline it lies. */
function layOut(file: string, size: Corner, idx: number, own: Ground | undefined): number {
  const bounds = own && boundsOf(own.polygon);
  const scale = bounds ? Math.max((bounds.high[0] - bounds.low[0]) / size[0], (bounds.high[1] - bounds.low[1]) / size[1]) : USUAL_WIDTH_M / size[0];
  const middle: Corner = bounds ? [(bounds.low[0] + bounds.high[0]) / 2, (bounds.low[1] + bounds.high[1]) / 2] : [0, 0];
  const target = own ? idx : addGround(rectangle(size[0] * scale, size[1] * scale), `picture ${file}`);
  editGround(target, say("ground.step.picture"), (of) => {
    // Another picture of the same size is most likely a better one of the same place.
    const before = of.imagery && sizes.value[of.imagery.file];
    const isSame = of.imagery && before && before[0] === size[0] && before[1] === size[1];
    return { ...of, imagery: isSame && of.imagery ? { ...of.imagery, file } : laidOut(file, size, scale, middle) };
  }, `picture ${file}`);
  settle();
  return target;
}

function Choose({ idx, own, onChoose }: { idx: number; own: Ground | undefined; onChoose: (idx: number) => void }) {
  const [failure, setFailure] = useState<string | null>(null);
  const take = async (file: File) => {
    try {
      const size = await sizeOf(file);
      const path = await keepFile(file);
      sizes.value = { ...sizes.value, [path]: size };
      onChoose(layOut(path, size, idx, own));
      setFailure(null);
    } catch (error) {
      setFailure(told(error));
    }
  };
  return (
    <>
      <label class="upload">
        {say(own?.imagery ? "ground.picture.other" : "ground.picture.choose")}
        <input type="file" accept="image/png,image/jpeg" onChange={(event) => {
          const [file] = event.currentTarget.files ?? [];
          if (file) void take(file);
          event.currentTarget.value = "";
        }} />
      </label>
      {failure !== null && <p class="fault" role="alert">{failure}</p>}
    </>
  );
}

function Tools({ idx }: { idx: number }) {
  const [metres, setMetres] = useState<number | null>(null);
  const chosen = tool.value;
  const drawn = line.value;
  const apply = () => {
    const move = drawn && metres !== null && byLength(drawn.from, drawn.to, metres);
    if (move) editImagery(idx, say("ground.step.length"), (of) => movedImagery(of, move));
    take("choose");
    setMetres(null);
  };
  return (
    <>
      <div class="row" role="group" aria-label={say("ground.place")}>
        {(["length", "north", "move"] as const).map((name) => (
          <button key={name} type="button" class={chosen === name ? "is-on" : ""} aria-pressed={chosen === name} onClick={() => take(chosen === name ? "choose" : name)}>
            {say(`ground.tool.${name}`)}
          </button>
        ))}
      </div>
      {(chosen === "length" || chosen === "north" || chosen === "move") && <p class="quiet" role="status">{say(`ground.tool.${chosen}.help`)}</p>}
      {chosen === "length" && drawn && (
        <form class="row bottom" onSubmit={(event) => {
          event.preventDefault();
          apply();
        }}>
          <NumberField label={say("ground.tool.length.metres")} unit="m" value={metres} isOptional min={0.01} max={1e5} onChange={setMetres} />
          <button type="submit" class="is-main" disabled={metres === null}>{say("ground.tool.length.apply")}</button>
        </form>
      )}
    </>
  );
}

function Placed({ idx, imagery, size }: { idx: number; imagery: Imagery; size: Corner }) {
  const origin = draft.value?.scene.document.origin;
  const map = mapOf(imagery, size, origin);
  const rows = map && worldFromPixel(map, size);
  if (!rows) return <p class="fault" role="status">{say(imagery.bounds && !origin ? "ground.bounds.noOrigin" : "ground.picture.lost")}</p>;
  const { middle, metresPerPixel, turnDeg } = described(rows, size);
  const move = (label: string, of: Parameters<typeof movedImagery>[1], key: string) => editImagery(idx, label, (before) => movedImagery(before, of), `${key} ${idx}`);
  const corners = (): Corner[] => [[0, 0], [size[0], 0], [size[0], size[1]], [0, size[1]]];
  const byPoints = () => editImagery(idx, say("ground.step.byPoints"), ({ file }) => ({
    file, transform: "affine", control_points: corners().map((pixel) => ({ pixel: [...pixel], world: [...applied(rows, pixel)] })),
  }));
  const byBounds = () => {
    const extent = boundsOf(corners().map((pixel) => applied(rows, pixel)));
    if (!origin || !extent) return;
    const [low, high] = [onEarth(origin, extent.low), onEarth(origin, extent.high)];
    const bounds = { west_deg: low.longitude_deg, south_deg: low.latitude_deg, east_deg: high.longitude_deg, north_deg: high.latitude_deg };
    editImagery(idx, say("ground.step.byBounds"), ({ file }) => ({ file, bounds }));
  };
  if (imagery.bounds) return <BoundsFields idx={idx} bounds={imagery.bounds} onPoints={byPoints} />;
  return (
    <>
      <Tools idx={idx} />
      <div class="row top">
        <NumberField label={say("ground.picture.scale")} unit={say("ground.picture.scale.unit")} value={metresPerPixel} places={5} min={1e-5} max={1e4}
          onChange={(value) => value && move(say("ground.step.length"), { about: middle, factor: value / metresPerPixel }, "scale")} />
        <NumberField label={say("ground.picture.turn")} unit="°" value={turnDeg} places={2} min={-360} max={360} hint={say("ground.picture.turn.hint")}
          onChange={(value) => move(say("ground.step.north"), { about: middle, turnDeg: (value ?? 0) - turnDeg }, "turn")} />
        <NumberField label={say("ground.picture.x")} unit="m" value={middle[0]} places={2} min={-1e8} max={1e8}
          onChange={(value) => move(say("ground.step.move"), { about: middle, shift: [(value ?? 0) - middle[0], 0] }, "x")} />
        <NumberField label={say("ground.picture.y")} unit="m" value={middle[1]} places={2} min={-1e8} max={1e8}
          onChange={(value) => move(say("ground.step.move"), { about: middle, shift: [0, (value ?? 0) - middle[1]] }, "y")} />
      </div>
      <details>
        <summary>{say("ground.points", { count: imagery.control_points?.length ?? 0, residual: digits(residual(rows, imagery), 3) })}</summary>
        <PointFields idx={idx} imagery={imagery} rows={rows} size={size} />
      </details>
      <p class="row">
        <button type="button" onClick={() => editGround(idx, say("ground.step.outline"), (of) => ({ ...of, polygon: corners().map((pixel) => rounded(applied(rows, pixel))) }))}>
          {say("ground.picture.outline")}
        </button>
        {origin && <button type="button" onClick={byBounds}>{say("ground.bounds.use")}</button>}
      </p>
    </>
  );
}

function BoundsFields({ idx, bounds, onPoints }: { idx: number; bounds: NonNullable<Imagery["bounds"]>; onPoints: () => void }) {
  const sides = ["west_deg", "south_deg", "east_deg", "north_deg"] as const;
  return (
    <>
      <div class="row top">
        {sides.map((side) => {
          const most = side === "west_deg" || side === "east_deg" ? 180 : 85;
          return (
            <NumberField key={side} label={say(`ground.bounds.${side}`)} unit="°" value={bounds[side]} places={7} min={-most} max={most} fault={atThing("ground", { ground: String(idx) }, `imagery/bounds/${side}`)}
              onChange={(value) => editImagery(idx, say("ground.step.byBounds"), (of) => ({ ...of, bounds: { ...bounds, [side]: value ?? 0 } }), `${side} ${idx}`)} />
          );
        })}
      </div>
      <p><button type="button" onClick={onPoints}>{say("ground.bounds.points")}</button></p>
    </>
  );
}

export function ImageryPanel({ idx, own, onChoose }: { idx: number; own: Ground | undefined; onChoose: (idx: number) => void }) {
  const imagery = own?.imagery;
  const { isMissing } = useUrl(imagery?.file);
  const size = imagery && sizes.value[imagery.file];
  return (
    <fieldset class="card" disabled={isReadOnly.value}>
      <legend class="hidden">{say("ground.picture")}</legend>
      <h2>{say("ground.picture")}</h2>
      {!imagery && <p class="quiet">{say("ground.picture.help")}</p>}
      <div class="row">
        <Choose idx={idx} own={own} onChoose={onChoose} />
        {imagery && (
          <button type="button" class="push" onClick={() => editGround(idx, say("ground.step.noPicture"), (of) => without(of, "imagery"))}>
            {say("ground.picture.remove")}
          </button>
        )}
      </div>
      {imagery && <p class="quiet">{imagery.file}{size ? `, ${size.join(" × ")}` : ""}</p>}
      {imagery && isMissing && <p class="note">{say("ground.picture.missing")}</p>}
      <p class="fault" role="status">{atThing("ground", { ground: String(idx) }, "imagery")}</p>
      {imagery && size && <Placed idx={idx} imagery={imagery} size={size} />}
    </fieldset>
  );
}
