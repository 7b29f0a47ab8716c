// Compares the calibrations of the scene's cameras by people whom several of them saw, and corrects them camera by camera.

import { Table } from "../../parts/parts";
import { say } from "../../strings";
import { type Line, useAlignment } from "../aligning";
import { equal } from "../changes";
import { calibrationOf, draft, isReadOnly, setCalibration } from "../draft";
import { metres } from "./FitBar";

function Apply({ line: { camera, calibration } }: { line: Line }) {
  const of = draft.value;
  if (!of || !calibration) return <span class="quiet">{say("agreement.nobody")}</span>;
  const { corrected, is_used } = calibration;
  if (!corrected) return <span class="quiet">{say("agreement.few")}</span>;
  if (equal(calibrationOf(of, camera), corrected)) return <span class="quiet">{say("estimate.applied")}</span>;
  if (!is_used) return <span class="quiet">{say("agreement.agrees")}</span>;
  const name = of.cameras.find(({ id }) => id === camera)?.name || camera;
  return (
    <button type="button" disabled={isReadOnly.value} onClick={() => setCalibration(camera, corrected, say("agreement.step", { name }))}>
      {say("estimate.apply")}
    </button>
  );
}

export function Agreement() {
  const { lines, failure, isPossible, isAsking, ask } = useAlignment();
  const of = draft.value;
  if (!of) return null;
  const row = (line: Line) => {
    const { calibration } = line;
    const off = calibration ? say("agreement.off.value", { offset: metres(calibration.offset_m), error: metres(calibration.offset_error_m) }) : "";
    const apart = calibration ? say("agreement.apart.value", { before: metres(calibration.apart_m), after: metres(calibration.apart_corrected_m) }) : "";
    const name = of.cameras.find(({ id }) => id === line.camera)?.name || line.camera;
    return [name, off, apart, calibration?.paths ?? 0, <Apply key={line.camera} line={line} />];
  };
  return (
    <details class="card fold">
      <summary><h2>{say("agreement.title")}</h2></summary>
      <p class="quiet">{say("agreement.help")} {!isPossible && say("agreement.unkept")}</p>
      <p><button type="button" disabled={!isPossible || isAsking} onClick={() => void ask()}>{say(lines ? "agreement.again" : "agreement.ask")}</button></p>
      {failure !== null && <p class="fault" role="alert">{failure}</p>}
      {lines && (
        <Table caption={say("agreement.title")} none={say("estimate.none")}
          columns={["column.camera", "agreement.off", "agreement.apart", "agreement.paths", "agreement.correction"]} rows={lines.map(row)} />
      )}
    </details>
  );
}
