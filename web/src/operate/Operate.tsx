// Operate: the scene as all cameras together see it, through time; beside it the cameras, people, named views and what is kept.

import "./operate.css";
import { useEffect, useRef } from "preact/hooks";
import { Segments } from "../parts/parts";
import { say } from "../strings";
import { CameraAlone } from "./CameraAlone";
import { CameraList } from "./CameraList";
import { Exports } from "./Exports";
import * as following from "./following";
import { DrawingChoice, DrawnBy } from "./browser/DrawnBy";
import { AboutPicture } from "./FusedView";
import { MapView } from "./MapView";
import { FollowPanel, PeopleList } from "./People";
import { Picture } from "./Picture";
import * as scenery from "./scenery";
import * as shortcuts from "./shortcuts";
import { Snapshots } from "./Snapshots";
import * as state from "./state";
import { Timeline } from "./Timeline";
import * as tracking from "./tracking";
import { Views, attend as attendViews } from "./Views";
import { MODES } from "./ways";
import { Welcome } from "./Welcome";
import { WhichCameras } from "./WhichCameras";

function Checked({ name, label, isOn }: { name: string; label: string; isOn: boolean }) {
  return (
    <label class="inline">
      <input type="checkbox" checked={isOn} onChange={(event) => state.choose(name, event.currentTarget.checked ? "on" : "off", "on")} /> {label}
    </label>
  );
}

/** How the picture is drawn. */
function PictureMenu() {
  return (
    <details class="menu">
      <summary>{say("view.settings")}</summary>
      <div class="menu-box">
        <Segments name="entities" label={say("entities.label")} values={state.ENTITIES} chosen={state.entities.value}
          text={(value) => say(`entities.${value}`)} onChoose={(value) => state.choose("entities", value, "billboards")} />
        <Segments name="quality" label={say("quality.label")} values={state.QUALITIES} chosen={state.quality.value}
          text={(value) => say(`quality.${value}`)} onChoose={(value) => state.choose("quality", value, "balanced")} />
        <DrawingChoice />
        <Checked name="see_through" label={say("see_through.label")} isOn={state.seeThrough.value === "on"} />
        <label class="inline">
          <input type="checkbox" checked={state.colors.value === "even"}
            onChange={(event) => state.choose("colors", event.currentTarget.checked ? "even" : "raw", "even")} /> {say("colors.label")}
        </label>
        <Segments name="fields" label={say("fields.label")} values={state.FIELDS} chosen={state.fields.value}
          text={(value) => say(`fields.${value}`)} onChoose={(value) => state.choose("fields", value, "off")} />
        <Segments name="occlusion" label={say("occlusion.label")} values={state.SWITCHES} chosen={state.occlusion.value}
          text={(value) => say(`effect.${value}`)} onChoose={(value) => state.choose("occlusion", value, "scene")} />
        <Segments name="relight" label={say("relight.label")} values={state.LIGHTS} chosen={state.relight.value}
          text={(value) => say(`effect.${value}`)} onChoose={(value) => state.choose("relight", value, "scene")} />
        <Segments name="stipple" label={say("stipple.label")} values={state.SWITCHES} chosen={state.stipple.value}
          text={(value) => say(`effect.${value}`)} onChoose={(value) => state.choose("stipple", value, "scene")} />
        <Checked name="labels" label={say("people.labels")} isOn={state.labels.value === "on"} />
        <Checked name="trails" label={say("people.trails")} isOn={state.trails.value === "on"} />
      </div>
    </details>
  );
}

const HELP_KEYS = ["orbit", "walk", "fly", "map", "follow", "views", "time", "place", "leave"] as const;

function Help() {
  const dialog = useRef<HTMLDialogElement>(null);
  return (
    <>
      <button type="button" aria-label={say("help.title")} title={say("help.title")} onClick={() => dialog.current?.showModal()}>?</button>
      <dialog ref={dialog} class="help" aria-label={say("help.title")}>
        <h2>{say("help.title")}</h2>
        <dl>{HELP_KEYS.map((key) => <div key={key}><dt><kbd>{say(`help.${key}.keys`)}</kbd></dt><dd>{say(`help.${key}`)}</dd></div>)}</dl>
        <form method="dialog"><button type="submit" class="is-main">{say("help.close")}</button></form>
      </dialog>
    </>
  );
}

/** How the viewer moves, the map, and how the picture is drawn: of the fused view. */
function Ways() {
  return (
    <>
      <Segments name="move" label={say("move.label")} values={MODES} chosen={state.mode.value}
        text={(value) => say(`move.${value}`)} onChoose={shortcuts.chooseMode} />
      <Segments name="map" label={say("map.title")} values={state.MAPS} chosen={state.map.value}
        text={(value) => say(`map.${value}`)} onChoose={(value) => state.choose("map", value, "inset")} />
      <PictureMenu />
      <button type="button" onClick={state.resetView} title={say("view.reset.title")}>{say("view.reset")}</button>
    </>
  );
}

function Choices({ onFullscreen }: { onFullscreen: () => void }) {
  const scenes = state.scenes.value ?? [];
  return (
    <div class="choices">
      <h1>{state.scene.value?.name ?? say("place.operate")}</h1>
      {scenes.length > 1 && (
        <label class="inline">
          {say("scene.label")}{" "}
          <select value={state.scene.value?.id ?? ""} onChange={(event) => state.showScene(event.currentTarget.value)}>
            {scenes.map(({ id, name }) => <option key={id} value={id}>{name}</option>)}
          </select>
        </label>
      )}
      {state.openedCamera.value === undefined && <Ways />}
      <button type="button" onClick={onFullscreen}>{say("view.fullscreen")}</button>
      <Help />
    </div>
  );
}

function Side() {
  return (
    <aside class="side" aria-label={say("side.title")}>
      <FollowPanel />
      <WhichCameras />
      <Segments name="side" label={say("side.title")} values={state.SIDES} chosen={state.side.value}
        text={(value) => say(`side.${value}`)} onChoose={(value) => state.choose("side", value, "cameras")} />
      {state.side.value === "cameras" && <CameraList />}
      {state.side.value === "people" && <PeopleList />}
      {state.side.value === "views" && <Views />}
      {state.side.value === "keep" && <><Snapshots /><Exports /></>}
    </aside>
  );
}

export default function Operate() {
  const area = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const stops = [scenery.attend(), tracking.track(), following.attend(), shortcuts.attend(), attendViews()];
    return () => stops.forEach((stop) => stop());
  }, []);
  const opened = state.openedCamera.value;
  if (state.scenes.value?.length === 0 && state.cameras.value?.length === 0) return <Welcome />;
  const isMapLarge = state.map.value === "large" && opened === undefined;
  return (
    <div class="operate">
      <section class="fused" aria-label={state.scene.value?.name ?? say("place.operate")}>
        <Choices onFullscreen={() => void area.current?.requestFullscreen().catch(() => null)} />
        <div class="area" ref={area}>
          {/* Kept beneath a camera's own picture and a large map, so that going back finds it as it was. */}
          <div class={isMapLarge ? "beside-map" : "whole"} hidden={opened !== undefined}><Picture /></div>
          {isMapLarge && <MapView isLarge />}
          {opened !== undefined && <CameraAlone id={opened} />}
          <Timeline />
        </div>
        {opened === undefined && <p id="stage-help" class="quiet">{say(`view.help.${state.mode.value}`)}</p>}
        {opened === undefined && <AboutPicture><DrawnBy /></AboutPicture>}
      </section>
      <Side />
    </div>
  );
}
