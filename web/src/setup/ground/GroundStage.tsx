// The stage Ground: the plane on which everything stands, its picture, and where on the earth it lies.

import { useEffect, useRef, useState } from "preact/hooks";
import { change, route } from "../../route";
import { say } from "../../strings";
import { draft, isReadOnly } from "../draft";
import { type Corner, type Frame, fitted } from "../plan/frame";
import { GroundMap, extent } from "./GroundMap";
import { ImageryPanel } from "./ImageryPanel";
import { OriginPanel } from "./OriginPanel";
import { OutlinePanel } from "./OutlinePanel";
import { take } from "./tools";

const UNMEASURED: Frame = { center: [0, 0], scale: 1, size_px: [0, 0] };

export default function GroundStage() {
  const document = draft.value?.scene.document;
  const grounds = document?.ground ?? [];
  const wanted = Number(route.value.details["ground"] ?? 0);
  const chosen = wanted < grounds.length ? wanted : 0;
  const choose = (idx: number) => change({ ground: idx === 0 ? null : String(idx) });
  const bounds = extent(grounds);
  const [frame, setFrame] = useState<Frame>(UNMEASURED);
  const hasGround = grounds.length > 0;
  const latest = useRef(bounds);
  latest.current = bounds;
  // Once the map's size is known, and when the first ground comes, all of it is shown.
  const isMeasured = frame.size_px[0] > 0;
  useEffect(() => {
    if (isMeasured) setFrame((before) => fitted(latest.current, before.size_px));
  }, [isMeasured, hasGround, draft.value?.scene.id]);
  useEffect(() => () => take("choose"), []);
  const middle: Corner = hasGround ? frame.center : [0, 0];
  return (
    <div class="ground">
      <section class="ground-map" aria-label={say("ground.title")}>
        <GroundMap frame={frame} onFrame={setFrame} chosen={chosen} onChoose={choose} />
        <div class="row">
          <button type="button" onClick={() => setFrame((before) => fitted(bounds, before.size_px))}>{say("ground.fit")}</button>
          {!isReadOnly.value && <p class="quiet">{say("ground.help")}</p>}
        </div>
      </section>
      <div class="ground-panels">
        <OutlinePanel grounds={grounds} chosen={chosen} onChoose={choose} around={middle} />
        <ImageryPanel idx={chosen} own={grounds[chosen]} onChoose={choose} />
        <OriginPanel bounds={bounds} />
      </div>
    </div>
  );
}
