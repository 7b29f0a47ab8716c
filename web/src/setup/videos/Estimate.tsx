// How far clocks are apart by the daemon's own estimate, to be taken over camera by camera.

import { Table } from "../../parts/parts";
import { say } from "../../strings";
import { type Line, useAlignment } from "../aligning";
import { equal } from "../changes";
import { draft, editCamera, isReadOnly } from "../draft";

/** Below this the daemon corrects no camera. */
const LEAST_CONFIDENCE = 0.5;

function Apply({ line }: { line: Line }) {
  const camera = draft.value?.cameras.find(({ id }) => id === line.camera);
  const { clock, confidence } = line;
  if (!clock || confidence === null) return <span class="quiet">{say("estimate.unknown")}</span>;
  if (confidence === 1 && line.ahead_secs === 0) return <span class="quiet">{say("estimate.reference")}</span>;
  if (!camera) return null;
  const after = { offset_secs: clock.offset_secs ?? 0, drift_ppm: clock.drift_ppm ?? 0, ...(clock.since ? { since: clock.since } : {}) };
  if (equal(camera.clock, after)) return <span class="quiet">{say("estimate.applied")}</span>;
  return (
    <>
      <button type="button" disabled={isReadOnly.value}
        onClick={() => editCamera(camera.id, say("step.clock", { name: camera.name || camera.id }), (of) => ({ ...of, clock: after }))}>
        {say("estimate.apply")}
      </button>
      {confidence < LEAST_CONFIDENCE && <span class="quiet"> {say("estimate.doubt")}</span>}
    </>
  );
}

export function Estimate() {
  const { lines, failure, isPossible, isAsking, ask } = useAlignment();
  const of = draft.value;
  if (!of) return null;
  const name = (id: string) => of.cameras.find((camera) => camera.id === id)?.name || id;
  return (
    <details class="card fold">
      <summary><h2>{say("estimate.title")}</h2></summary>
      <p class="quiet">{say("estimate.help")} {!isPossible && say("estimate.unkept")}</p>
      <p><button type="button" disabled={!isPossible || isAsking} onClick={() => void ask()}>{say(lines ? "estimate.again" : "estimate.ask")}</button></p>
      {failure !== null && <p class="fault" role="alert">{failure}</p>}
      {lines && (
        <Table caption={say("estimate.title")} none={say("estimate.none")} columns={["column.camera", "estimate.ahead", "estimate.confidence", "estimate.apply"]}
          rows={lines.map((line) => [name(line.camera), line.ahead_secs?.toFixed(3) ?? "", line.confidence?.toFixed(2) ?? "", <Apply key={line.camera} line={line} />])} />
      )}
    </details>
  );
}
