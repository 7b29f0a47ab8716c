// The map in a corner of the picture.

import { say } from "../strings";
import { MapView } from "./MapView";
import * as state from "./state";

export function MapInset() {
  return (
    <div class="map-inset" data-own>
      <MapView isLarge={false} />
      <span class="map-buttons">
        <button type="button" onClick={() => state.choose("map", "large", "inset")} aria-label={say("map.enlarge")} title={say("map.enlarge")}>⤢</button>
        <button type="button" onClick={() => state.choose("map", "off", "inset")} aria-label={say("map.close")} title={say("map.close")}>×</button>
      </span>
    </div>
  );
}
