// A calibration from elsewhere: any format that the daemon reads, looked at before it is taken over. What the text leaves open is
// asked for once the daemon says so.

import { type Signal, useSignal } from "@preact/signals";
import { Trouble, told } from "../../ask";
import { say } from "../../strings";
import type { Calibration } from "../draft";
import { Facts } from "../../parts/parts";
import { NumberField, TextField } from "../Fields";
import { type ImportOptions, importCalibration } from "../requests";
import { anglesOf, fovOf } from "./holding";
import * as now from "./now";

const FORMATS = ["auto", "tsai", "opencv", "json"] as const;
type Format = (typeof FORMATS)[number];
/** What may be asked for, and by which words of the daemon. */
const ASKED = { entry: /\bentry\b|several cameras|no camera is named/, image_size_px: /image_size_px/, metres_per_unit: /metres_per_unit|metres a unit/ } as const;
type Asked = keyof typeof ASKED;

type State = {
  readonly text: string;
  readonly name: string;
  readonly format: Format;
  readonly asked: readonly Asked[];
  readonly entry: string;
  readonly entries: readonly string[];
  readonly size: string;
  readonly unit: number | null;
  readonly failure: string | null;
  readonly read: { readonly calibration: Calibration; readonly residual_px: number | null } | null;
};
const EMPTY: State = { text: "", name: "", format: "auto", asked: [], entry: "", entries: [], size: "", unit: null, failure: null, read: null };

/** What the daemon's refusal asks for, and the names that it knows. */
export function askedBy(error: unknown): { asked: Asked[]; entries: string[] } {
  const faults = error instanceof Trouble ? error.faults : [];
  const words = [told(error), ...faults.map(({ pointer, parameter, detail }) => `${parameter ?? pointer ?? ""} ${detail}`)].join("\n");
  const asked = (Object.keys(ASKED) as Asked[]).filter((name) => ASKED[name].test(words));
  const entries = asked.includes("entry") ? [...new Set([...words.matchAll(/"([^"]+)"/g)].map(([, name = ""]) => name))] : [];
  return { asked, entries };
}

function optionsOf({ format, entry, size, unit }: State): ImportOptions {
  return {
    ...(format !== "auto" && { format }),
    ...(entry.trim() !== "" && { entry: entry.trim() }),
    ...(size.trim() !== "" && { image_size_px: size.trim().replace(/\s*[x×*]\s*/i, "x") }),
    ...(unit !== null && { metres_per_unit: unit }),
  };
}

async function read(of: Signal<State>): Promise<void> {
  const camera = now.chosen.value;
  const asked = of.value;
  if (!camera || asked.text.trim() === "") return;
  try {
    const got = await importCalibration(asked.text, optionsOf(asked));
    if (of.value.text !== asked.text) return;
    of.value = { ...of.value, failure: null, read: got };
    now.proposal.value = { camera: camera.id, calibration: got.calibration, from: "import" };
  } catch (error) {
    const { asked: more, entries } = askedBy(error);
    const faults = error instanceof Trouble ? error.faults.map(({ pointer = "", detail }) => `${pointer} ${detail}`.trim()) : [];
    of.value = {
      ...of.value, read: null,
      failure: [told(error), ...faults.filter((fault) => !told(error).includes(fault))].join(" "),
      asked: [...new Set([...of.value.asked, ...more])],
      entries: entries.length > 0 ? entries : of.value.entries,
    };
    if (now.proposal.value?.from === "import") now.proposal.value = null;
  }
}

function Readings({ of, residual_px }: { of: Calibration; residual_px: number | null }) {
  const { heading_deg, tilt_deg, roll_deg } = anglesOf(of);
  const natural = now.chosen.value && now.pictureSizes.value[now.chosen.value.id];
  const [width = 0, height = 0] = of.image_size_px;
  const isOtherShape = natural && Math.abs(natural[0] / natural[1] - width / height) > 0.01;
  return (
    <>
      <Facts facts={[
        ["cameras.import.place", of.position_m.map((m) => m.toFixed(2)).join(", ")],
        ["cameras.import.direction", say("cameras.import.direction.text", { heading: heading_deg.toFixed(1), tilt: tilt_deg.toFixed(1), roll: roll_deg.toFixed(1) })],
        ["cameras.import.size.of", of.image_size_px.join(" × ")],
        ["cameras.import.lens", say("cameras.import.lens.text", { fov: fovOf(of).toFixed(1), model: say(`cameras.lens.${of.distortion?.model ?? "none"}`) })],
        ["cameras.import.residual", residual_px === null ? say("cameras.import.residual.none") : say("cameras.fit.px", { px: residual_px.toFixed(2) })],
      ]} />
      {isOtherShape && <p class="cal-refused">{say("cameras.import.shape", { size: natural.join(" × ") })}</p>}
    </>
  );
}

function More({ of, set }: { of: State; set: (change: Partial<State>) => void }) {
  if (of.asked.length === 0) return null;
  return (
    <div class="row top">
      {of.asked.includes("entry") && (of.entries.length > 0
        ? (
          <label class="field">{say("cameras.import.entry")}
            <select value={of.entry} onChange={(event) => set({ entry: event.currentTarget.value })}>
              <option value="">{say("cameras.import.entry.choose")}</option>
              {of.entries.map((name) => <option key={name} value={name}>{name}</option>)}
            </select>
          </label>
        )
        : <TextField label={say("cameras.import.entry")} value={of.entry} onInput={(entry) => set({ entry })} />)}
      {of.asked.includes("image_size_px") && (
        <TextField label={say("cameras.import.size")} hint={say("cameras.import.size.hint")} placeholder="768x576" value={of.size} onInput={(size) => set({ size })} />
      )}
      {of.asked.includes("metres_per_unit") && (
        <NumberField label={say("cameras.import.unit")} hint={say("cameras.import.unit.hint")} unit="m" places={9} min={1e-9} isOptional value={of.unit} onChange={(unit) => set({ unit })} />
      )}
    </div>
  );
}

export function ImportPanel() {
  const of = useSignal<State>(EMPTY);
  const set = (change: Partial<State>) => (of.value = { ...of.value, ...change });
  const takeFile = async (file: File | undefined) => {
    if (!file) return;
    set({ text: await file.text(), name: file.name, asked: [], entries: [], entry: "", failure: null, read: null });
    await read(of);
  };
  const { text, format, failure, read: got } = of.value;
  return (
    <div class="cal-panel">
      <form class="cal-column" onSubmit={(event) => {
        event.preventDefault();
        void read(of);
      }}>
        <p>{say("cameras.import.about")}</p>
        <div class="row top">
          <label class="field">{say("cameras.import.file")}
            <input type="file" accept=".xml,.yaml,.yml,.json,.txt" onChange={(event) => void takeFile(event.currentTarget.files?.[0])} />
          </label>
          <label class="field">{say("cameras.import.format")}
            <select value={format} onChange={(event) => set({ format: event.currentTarget.value as Format })}>
              {FORMATS.map((name) => <option key={name} value={name}>{say(`cameras.import.format.${name}`)}</option>)}
            </select>
          </label>
        </div>
        <label class="field">{say("cameras.import.text")}
          <textarea rows={6} spellcheck={false} value={text} onInput={(event) => set({ text: event.currentTarget.value, read: null })} />
        </label>
        <More of={of.value} set={set} />
        <p><button type="submit" disabled={text.trim() === ""}>{say("cameras.import.read")}</button></p>
      </form>
      <div class="cal-column" role="status" aria-live="polite">
        {failure !== null && <p class="cal-refused">{failure}</p>}
        {got && <Readings of={got.calibration} residual_px={got.residual_px} />}
      </div>
    </div>
  );
}
