// What is of the whole scene: its sky, the view it opens with, and what is too small to be somebody.

import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { type SceneDocument, isReadOnly, settle } from "../draft";
import { atThing } from "../faults";
import { NumberField } from "../Fields";
import { changeScene } from "./actions";
import { PictureField } from "./PictureField";
import { shown, view } from "./state";

type Sky = NonNullable<SceneDocument["sky"]>;
const FORMS = ["color", "gradient", "picture"] as const;
type Form = (typeof FORMS)[number];
const PLAIN = "#87b5dd";
const GRADIENT = { zenith_srgb: "#3a6fb0", horizon_srgb: "#cfdde8", ground_srgb: "#6b665c" } as const;
const PARTS = ["zenith_srgb", "horizon_srgb", "ground_srgb"] as const;

const formOf = (sky: Sky): Form => (sky.picture ? "picture" : sky.gradient ? "gradient" : "color");

function setSky(sky: Sky, key: string): void {
  changeScene(say("geometry.step.sky"), `sky ${key}`, (document) => ({ ...document, sky }));
}

function Color({ label, value, onChange }: { label: string; value: string; onChange: (color: string) => void }) {
  return (
    <label class="geo-color">
      <input type="color" value={value} onInput={(event) => onChange(event.currentTarget.value)} onChange={settle} /> {label}
    </label>
  );
}

function SkyFields({ sky, form }: { sky: Sky; form: Form }) {
  if (form === "color") {
    return <Color label={say("geometry.sky.one")} value={sky.color_srgb ?? PLAIN} onChange={(color_srgb) => setSky({ color_srgb }, "color")} />;
  }
  if (form === "gradient") {
    const gradient = sky.gradient ?? GRADIENT;
    return <>{PARTS.map((part) => (
      <Color key={part} label={say(`geometry.sky.${part}`)} value={gradient[part]} onChange={(color) => setSky({ gradient: { ...gradient, [part]: color } }, part)} />
    ))}</>;
  }
  return (
    <>
      <PictureField label={say("geometry.sky.file")} file={sky.picture?.file} fault={atThing("geometry", { thing: "sky" }, "picture")}
        onPicture={(file) => setSky({ picture: { ...sky.picture, file } }, "file")} />
      <p class="quiet">{say("geometry.sky.file.hint")}</p>
      {sky.picture && (
        <NumberField label={say("geometry.sky.yaw")} unit="°" min={-360} max={360} value={sky.picture.yaw_deg ?? 0}
          onChange={(yaw_deg) => yaw_deg !== null && sky.picture && setSky({ picture: { ...sky.picture, yaw_deg } }, "yaw")} />
      )}
    </>
  );
}

function SkyPart() {
  const sky = shown.value.sky ?? { color_srgb: PLAIN };
  const form = formOf(sky);
  const take = (next: Form) => {
    if (next === "color") setSky({ color_srgb: sky.gradient?.zenith_srgb ?? PLAIN }, "form");
    else if (next === "gradient") setSky({ gradient: { ...GRADIENT, zenith_srgb: sky.color_srgb ?? GRADIENT.zenith_srgb } }, "form");
  };
  return (
    <>
      <Segments name="geo-sky" label={say("geometry.sky.form")} values={sky.picture ? FORMS : (["color", "gradient"] as const)} chosen={form}
        text={(value) => say(`geometry.sky.${value}`)} onChoose={take} />
      <SkyFields sky={sky} form={form} />
      {form !== "picture" && (
        <PictureField label={say("geometry.sky.file")} file={undefined} onPicture={(file) => setSky({ picture: { file } }, "file")} />
      )}
    </>
  );
}

function openHere(): void {
  const at = view.value;
  if (!at) return;
  const round = (place: readonly number[]) => place.map((metres) => Number(metres.toFixed(3)));
  changeScene(say("geometry.step.view"), "view", (document) => ({
    ...document, view: { eye_m: round(at.eye), target_m: round(at.target), fov_deg: Number(at.fov.toFixed(2)) },
  }));
}

export function ScenePanel({ isOpen }: { isOpen: boolean }) {
  return (
    <section class="card geo-panel" aria-label={say("geometry.scene")}>
      <fieldset class="plain" disabled={isReadOnly.value}>
        <h2>{say("geometry.scene")}</h2>
        {!isOpen && <p class="quiet">{say("geometry.choose")}</p>}
        <details open={isOpen} key={String(isOpen)}>
          <summary>{say("geometry.sky")}</summary>
          <div class="geo-sky"><SkyPart /></div>
        </details>
        <NumberField label={say("geometry.smallest")} hint={say("geometry.smallest.hint")} unit="m" min={0} max={10} value={shown.value.entities?.min_size_m ?? 0}
          onChange={(value) => value !== null && changeScene(say("geometry.step.smallest"), "smallest", (document) => ({ ...document, entities: { min_size_m: value } }))} />
        <div class="row">
          <button type="button" disabled={view.value === null} title={say("geometry.opens.title")} onClick={openHere}>{say("geometry.opens")}</button>
        </div>
      </fieldset>
    </section>
  );
}
