// The stage Geometry: what stands in the scene is drawn on a map and in a view, over what the cameras see.

import "./geometry.css";
import { useEffect, useMemo } from "preact/hooks";
import { say } from "../../strings";
import { draft } from "../draft";
import { DrawBar } from "./DrawBar";
import { put } from "./drawings";
import { Exchange } from "./Exchange";
import { MapPane } from "./MapPane";
import { Panel } from "./Panel";
import { cancelDrag } from "./pointing";
import { beginScene, layout, said } from "./state";
import { ThingList } from "./ThingList";
import { ToolBar } from "./ToolBar";
import { ViewPane } from "./ViewPane";

export default function GeometryStage() {
  useEffect(() => () => {
    cancelDrag();
    put("select");
    said.value = "";
  }, []);
  const shows = layout.value;
  const id = draft.value?.scene.id ?? "";
  // Before map and view ask what they show.
  useMemo(() => beginScene(id), [id]);
  return (
    <div class="geo">
      <ToolBar />
      <div class="geo-main">
        <div class={`geo-panes is-${shows}`}>
          {shows !== "view" && <MapPane key={id} />}
          {shows !== "map" && <ViewPane key={id} />}
        </div>
        <DrawBar />
        <p class="geo-said" role="status">{said.value}</p>
        <details class="geo-keys">
          <summary>{say("geometry.keys.title")}</summary>
          <p id="geometry-keys" class="quiet">{say("geometry.keys")}</p>
        </details>
      </div>
      <div class="geo-side">
        <Panel />
        <ThingList />
        <Exchange />
      </div>
    </div>
  );
}
