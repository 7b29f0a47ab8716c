// What stands there, seen from straight above, to draw and drag on.

import { useMemo } from "preact/hooks";
import { say } from "../../strings";
import type { Frame } from "../plan/frame";
import { PlanMap, pointsOf } from "../plan/PlanMap";
import { planEye } from "./eye";
import { onKey } from "./keys";
import { MapPictures } from "./MapPictures";
import { Overlay } from "./Overlay";
import { pointing } from "./pointing";
import { chosen, cursor, fileExtents, frame, grid, hidden, liveName, opacityName, shown, wholeFrame } from "./state";
import { COLOR, extentOf, things } from "./things";

const UNSEEN: Frame = { center: [0, 0], scale: 10, size_px: [0, 0] };
/** Things that are smaller on the map have no name there. */
const NAMED_PX = 44;

/** The map changed by a gesture, or by the size that it was given: then it first shows everything. */
export function changeFrame(change: (frame: Frame) => Frame): void {
  const next = change(frame.value ?? UNSEEN);
  frame.value = frame.value === null ? wholeFrame(next.size_px) : next;
}

/** What is drawn beneath shows through. */
const CLEAR = 0.12;

function Things({ at }: { at: Frame }) {
  const opacity = liveName.value === "off" ? Number(opacityName.value) * 0.9 : CLEAR;
  const drawn = things(shown.value)
    .filter(({ list, of }) => list !== "height_fields" && !hidden.value.has(of.id))
    .map((one) => ({ id: one.of.id, color: one.of.color_srgb ?? COLOR, extent: extentOf(one, fileExtents.value) }))
    // What is higher lies over what is lower.
    .sort((a, b) => a.extent.high - b.extent.high);
  return (
    <g class="geo-things">
      {drawn.map(({ id, color, extent }) => {
        const xs = extent.outline.map(([x]) => x);
        const width = (Math.max(...xs) - Math.min(...xs)) * at.scale;
        const [x, y] = pointsOf(at, [extent.middle]).split(",").map(Number);
        return (
          <g key={id} class={chosen.value.includes(id) ? "is-chosen" : undefined}>
            <polygon points={pointsOf(at, extent.outline)} style={{ fill: color, fillOpacity: opacity }} />
            {width > NAMED_PX && <text x={x} y={y}>{id}</text>}
          </g>
        );
      })}
    </g>
  );
}

export function MapPane() {
  const at = frame.value ?? UNSEEN;
  const isLive = liveName.value !== "off";
  const handlers = useMemo(() => pointing(() => planEye(frame.value ?? UNSEEN)), []);
  return (
    <PlanMap label={say("geometry.map")} frame={at} onFrame={changeFrame} document={shown.value} gridStep={grid.value}
      cursor={cursor.value} onKeyDown={onKey}
      isGroundClear={isLive} under={isLive && at.size_px[0] > 0 ? <MapPictures frame={at} /> : undefined}
      handlers={handlers}>
      {at.size_px[0] > 0 && (
        <>
          <Things at={at} />
          <Overlay eye={planEye(at)} />
        </>
      )}
    </PlanMap>
  );
}
