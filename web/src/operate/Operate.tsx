// Operate: the scene as all cameras together see it, through time; the cameras beside it.

import { useRef } from "preact/hooks";
import { change } from "../route";
import { Segments } from "../parts/parts";
import { say } from "../strings";
import { CameraAlone } from "./CameraAlone";
import { CameraList } from "./CameraList";
import { AboutPicture, FusedView } from "./FusedView";
import { Timeline } from "./Timeline";
import * as state from "./state";

/** A choice that stands in the address where it is not the usual one. */
function choose(name: string, value: string, usual: string): void {
  change({ [name]: value === usual ? null : value });
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
      <Segments name="entities" label={say("entities.label")} values={state.ENTITIES} chosen={state.entities.value}
        text={(value) => say(`entities.${value}`)} onChoose={(value) => choose("entities", value, "billboards")} />
      <details class="menu">
        <summary>{say("view.settings")}</summary>
        <div class="menu-box">
          <Segments name="quality" label={say("quality.label")} values={state.QUALITIES} chosen={state.quality.value}
            text={(value) => say(`quality.${value}`)} onChoose={(value) => choose("quality", value, "balanced")} />
          <label class="inline">
            <input type="checkbox" checked={state.seeThrough.value === "on"}
              onChange={(event) => choose("see_through", event.currentTarget.checked ? "on" : "off", "on")} />
            {" "}{say("see_through.label")}
          </label>
          <label class="inline">
            <input type="checkbox" checked={state.colors.value === "even"}
              onChange={(event) => choose("colors", event.currentTarget.checked ? "even" : "raw", "even")} />
            {" "}{say("colors.label")}
          </label>
        </div>
      </details>
      <button type="button" onClick={state.resetView} title={say("view.reset.title")}>{say("view.reset")}</button>
      <button type="button" onClick={onFullscreen}>{say("view.fullscreen")}</button>
    </div>
  );
}

export default function Operate() {
  const area = useRef<HTMLDivElement>(null);
  const opened = state.openedCamera.value;
  return (
    <div class="operate">
      <section class="fused" aria-label={state.scene.value?.name ?? say("place.operate")}>
        <Choices onFullscreen={() => void area.current?.requestFullscreen().catch(() => null)} />
        <div class="area" ref={area}>
          {opened === undefined ? <FusedView /> : <CameraAlone id={opened} />}
          <Timeline />
        </div>
        <p id="stage-help" class="quiet">{say("view.help.turn")} {say("time.help")}</p>
        {opened === undefined && <AboutPicture />}
      </section>
      <CameraList />
    </div>
  );
}
