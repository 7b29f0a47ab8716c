// The stage Cameras: where each camera stands and how its lens sees, by pairs, by hand, by a building's lines or from a file.

import "./cameras.css";
import { useSignalEffect } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { draft, isReadOnly } from "../draft";
import { wayToStage } from "../Stages";
import { Agreement } from "./Agreement";
import { CameraChoice } from "./CameraChoice";
import { FitBar } from "./FitBar";
import { ImportPanel } from "./ImportPanel";
import { LinesPanel } from "./LinesPanel";
import * as now from "./now";
import { PairsPanel } from "./PairsPanel";
import { PicturePane } from "./PicturePane";
import { forget } from "./pictures";
import { follow as followScene } from "./scene";
import { ScenePane } from "./ScenePane";
import { follow as followPairs } from "./solving";
import { TorchPanel } from "./TorchPanel";

const PANELS = { pairs: PairsPanel, torch: TorchPanel, lines: LinesPanel, import: ImportPanel } as const;

export default function CamerasStage() {
  useEffect(() => {
    const ends = [followScene(), followPairs()];
    return () => {
      for (const end of ends) end();
      forget();
      [now.half.value, now.proposal.value, now.pointed.value] = [null, null, null];
    };
  }, []);
  // Undoing may take a chosen pair away.
  useSignalEffect(() => {
    const n = now.pairs.value.length;
    if (now.selected.value !== null && now.selected.value >= n) now.selected.value = null;
  });
  const camera = now.chosen.value;
  if (!draft.value) return null;
  if (!camera) return <p>{say("cameras.none")} <a href={wayToStage("videos")}>{say("cameras.none.go")}</a></p>;
  const Panel = PANELS[now.how.value];
  return (
    <div class="cal">
      <div class="cal-ways">
        <CameraChoice />
        <Segments name="cal-how" label={say("cameras.how")} values={now.HOWS} chosen={now.how.value} text={(value) => say(`cameras.how.${value}`)} onChoose={now.chooseHow} />
        <p class="quiet">{say(`cameras.how.${now.how.value}.about`)}</p>
      </div>
      <div class="cal-panes">
        <PicturePane camera={camera} />
        <ScenePane />
      </div>
      <section class="card" aria-label={say(`cameras.how.${now.how.value}`)}>
        <Panel key={camera.id} />
      </section>
      <FitBar />
      {!isReadOnly.value && <Agreement />}
    </div>
  );
}
