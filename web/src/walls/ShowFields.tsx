// What a wall shows: the scene, from where, at which time, how often, and in which way. A named view or the one on Operate is taken
// over with a click.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../ask";
import type { components } from "../contract.gen";
import { type View, read } from "../operate/orbit";
import * as state from "../operate/state";
import { useAsked } from "../parts/parts";
import { say } from "../strings";
import type { Faults } from "./validity";
import { type Wall, seenFrom, viewerOf } from "./document";
import { draft, edit } from "./draft";
import { NumberField, NumbersField, SelectField, TextField } from "./fields";

type NamedView = components["schemas"]["NamedView"] & { id: string };

const AGAIN_MILLIS = 10_000;
const AXES = ["x", "y", "z"];
/** What a view's parameters say that the wall says itself. */
const OWN = ["projection", "eye", "target", "fov", "width", "height", "t", "session"];

/** The scene's own view, as the daemon makes it out. */
export async function ownView(scene: string): Promise<View | null> {
  const { view } = await content(api.GET("/api/v1/scenes/{id}/plan", { params: { path: { id: scene } } }));
  const { eye, target, fov } = view as { eye?: number[]; target?: number[]; fov?: number };
  return read({ eye: (eye ?? []).join(","), target: (target ?? []).join(","), fov: String(fov ?? 45) });
}

/** A wall that shows what a named view does. */
async function asNamed(wall: Wall, named: NamedView): Promise<Wall> {
  const parts = Object.fromEntries(new URLSearchParams(named.parameters ?? ""));
  const usual = await ownView(named.scene);
  const [eye, target] = [parts["eye"] ?? usual?.eye.join(","), parts["target"] ?? usual?.target.join(",")];
  const view = read({ eye: eye ?? "", target: target ?? "", fov: parts["fov"] ?? String(usual?.fov ?? 45) }) ?? usual;
  const others = Object.entries(parts).filter(([name]) => !OWN.includes(name));
  const parameters = others.map(([name, value]) => `${name}=${value}`).join("&");
  return view ? { ...seenFrom({ ...wall, scene: named.scene }, view), parameters } : wall;
}

/** Only what looks straight through a window can be a wall's view. */
const isFlat = ({ parameters }: NamedView) => (new URLSearchParams(parameters ?? "").get("projection") ?? "perspective") === "perspective";

function Assign({ wall }: { wall: Wall }) {
  const views = useAsked(async () => (await content(api.GET("/api/v1/views", { params: { query: {} } }))).views, AGAIN_MILLIS);
  const [trouble, setTrouble] = useState("");
  const assign = async (make: () => Promise<Wall>) => {
    try {
      setTrouble("");
      const next = await make();
      edit((now) => ({ ...now, scene: next.scene, eye_m: next.eye_m, target_m: next.target_m, zoom: next.zoom, parameters: next.parameters }));
    } catch (error) {
      setTrouble(told(error));
    }
  };
  const fromOperate = async () => {
    const scene = state.scene.value?.id ?? wall.scene;
    const view = state.view.value ?? (await ownView(scene));
    return view ? seenFrom({ ...wall, scene }, view) : wall;
  };
  const named = (views.data ?? []).filter(isFlat);
  return (
    <div class="choices">
      <button type="button" onClick={() => void assign(fromOperate)}>{say("wall.view.operate")}</button>
      <label class="inline">
        <span class="hidden">{say("wall.view.named")}</span>
        <select value="" disabled={named.length === 0} onChange={(event) => {
          const chosen = named.find(({ id }) => id === event.currentTarget.value);
          event.currentTarget.value = "";
          if (chosen) void assign(() => asNamed(wall, chosen));
        }}>
          <option value="">{say(named.length > 0 ? "wall.view.named" : "wall.view.noNamed")}</option>
          {named.map(({ id, name, group }) => <option key={id} value={id}>{[group, name ? name : id].filter(Boolean).join(": ")}</option>)}
        </select>
      </label>
      {(trouble || views.failure) && <p class="wrong" role="alert">{trouble || views.failure}</p>}
    </div>
  );
}

/** Whose time the wall shows; a playhead of its own is made here. */
function Time({ wall, faults }: { wall: Wall; faults: Faults }) {
  const playheads = useAsked(async () => (await content(api.GET("/api/v1/playheads"))).playheads, AGAIN_MILLIS);
  const [made, setMade] = useState<string[]>([]);
  const [trouble, setTrouble] = useState("");
  const ids = [...new Set([...(playheads.data ?? []).filter(({ scene }) => scene === wall.scene).map(({ id }) => id), ...made, ...(wall.playhead === null ? [] : [wall.playhead])])];
  const own = draft.value?.id ?? "";
  const make = async () => {
    try {
      setTrouble("");
      await change("PUT", `/api/v1/playheads/${encodeURIComponent(own)}`, { scene: wall.scene }, { tag: null });
      setMade([...made, own]);
      edit((of) => ({ ...of, playhead: own }));
    } catch (error) {
      setTrouble(told(error));
    }
  };
  return (
    <>
      <SelectField label={say("wall.playhead")} pointer="/playhead" faults={faults} value={wall.playhead ?? ""}
        options={[["", say("wall.playhead.live")], ...ids.map((id) => [id, id] as const)]}
        onChange={(id) => edit((of) => ({ ...of, playhead: id === "" ? null : id }))} />
      {own !== "" && !ids.includes(own) && <button type="button" onClick={() => void make()}>{say("wall.playhead.make", { id: own })}</button>}
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </>
  );
}

export function ShowFields({ wall, faults }: { wall: Wall; faults: Faults }) {
  const set = (part: Partial<Wall>) => edit((of) => ({ ...of, ...part }), Object.keys(part).join());
  const known = (state.scenes.value ?? []).map(({ id, name }) => [id, name === id ? id : `${name} (${id})`] as const);
  const scenes = known.some(([id]) => id === wall.scene) ? known : [...known, [wall.scene, wall.scene] as const];
  return (
    <section class="card" aria-label={say("wall.shows")}>
      <h2>{say("wall.shows")}</h2>
      <Assign wall={wall} />
      <div class="entries">
        <SelectField label={say("wall.scene")} pointer="/scene" faults={faults} value={wall.scene} options={scenes} onChange={(scene) => set({ scene, playhead: null })} />
        <Time wall={wall} faults={faults} />
        <NumberField label={say("wall.rate")} pointer="/rate_hz" faults={faults} value={wall.rate_hz} step={0.5} unit={say("wall.rate.unit")} onChange={(rate_hz) => set({ rate_hz })} />
        <NumberField label={say("wall.zoom")} pointer="/zoom" faults={faults} value={wall.zoom} step={0.05} onChange={(zoom) => set({ zoom })} />
        <NumbersField label={say("wall.eye")} pointer="/view/eye_m" faults={faults} values={wall.eye_m} names={AXES} step={0.1} unit="m" onChange={(eye_m) => set({ eye_m })} />
        <NumbersField label={say("wall.target")} pointer="/view/target_m" faults={faults} values={wall.target_m} names={AXES} step={0.1} unit="m" onChange={(target_m) => set({ target_m })} />
      </div>
      <label>
        <input type="checkbox" checked={wall.viewer_m !== null} onChange={(event) => set({ viewer_m: event.currentTarget.checked ? viewerOf(wall) : null })} />{" "}
        {say("wall.viewer.own")}
      </label>
      {wall.viewer_m ? (
        <NumbersField label={say("wall.viewer")} pointer="/viewer_m" faults={faults} values={wall.viewer_m} names={AXES} step={0.05} unit="m" onChange={(viewer_m) => set({ viewer_m })} />
      ) : faults.get("/viewer_m") !== undefined && <p class="wrong">{faults.get("/viewer_m")}</p>}
      <TextField label={say("wall.parameters")} pointer="/parameters" faults={faults} value={wall.parameters} help={say("wall.parameters.help")} onChange={(parameters) => set({ parameters })} />
    </section>
  );
}
