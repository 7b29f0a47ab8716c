// Accuracy: what each step of exactness costs on this machine, and what error it leaves.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../../ask";
import type { components } from "../../contract.gen";
import { Table, useAsked } from "../../parts/parts";
import { session } from "../../session";
import { say, sayWord } from "../../strings";
import { Part, when } from "../Part";
import { Chart } from "./Chart";
import { type Curve, curves } from "./curves";
import { short } from "./scale";
import { Slider } from "./Slider";

type Told = components["schemas"]["Accuracy"];

const EVERY_MILLIS = 2_000;
const BUSY = ["pending", "measuring"];

/** How far the measuring is, where that is told (to admins). */
async function progress(): Promise<number | null> {
  const { jobs } = await content(api.GET("/api/v1/jobs", { params: { query: { kind: "accuracy" } } }));
  return jobs.find(({ state }) => state === "running" || state === "waiting")?.progress ?? null;
}

async function learn(): Promise<{ told: Told; share: number | null }> {
  const told = await content(api.GET("/api/v1/accuracy"));
  return { told, share: BUSY.includes(told.state) ? await progress().catch(() => null) : null };
}

function Measuring({ told: { state, reason, table }, share, onAsked }: { told: Told; share: number | null; onAsked: () => void }) {
  const [trouble, setTrouble] = useState("");
  const isBusy = BUSY.includes(state);
  const measure = async () => {
    try {
      setTrouble("");
      await change("POST", "/api/v1/accuracy");
      onAsked();
    } catch (error) {
      setTrouble(told(error));
    }
  };
  return (
    <>
      {table && (
        <p class="quiet">
          {say("system.accuracy.of", {
            subject: table.subject, at: when(table.measured_at), secs: table.took_secs.toFixed(0), processor: table.machine.processor, n: table.machine.n_processors,
            adapter: table.machine.adapter, version: table.machine.version, build: table.machine.build,
          })}{" "}
          {!table.is_complete && say("system.accuracy.incomplete")}
        </p>
      )}
      <div class="choices">
        {session.value?.role === "admin" && <button type="button" disabled={isBusy} onClick={() => void measure()}>{say("system.accuracy.measure")}</button>}
        <p role="status">{sayWord("system.accuracy.state", state)} {reason ?? ""}</p>
        {isBusy && <progress aria-label={say("system.accuracy.progress")} max={1} {...(share === null ? {} : { value: share })} />}
      </div>
      {state === "pending" && <p class="quiet">{say("system.accuracy.pending")}</p>}
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </>
  );
}

function OfStage({ curve }: { curve: Curve }) {
  const name = sayWord("system.stage", curve.stage);
  const errorName = sayWord("system.stage.error", curve.stage);
  return (
    <section class="card" aria-label={name}>
      <h2>{name}</h2>
      <p class="quiet">{sayWord("system.work", curve.stage)}</p>
      {curve.points.length > 0 && <Chart curve={curve} title={say("system.chart", { stage: name })} errorName={errorName} />}
      <details class="more" open={curve.points.length <= 6}>
        <summary>{say("system.chart.table")}</summary>
        <Table caption={say("system.chart", { stage: name })} none={say("system.accuracy.unjudged")} columns={["column.setting", "column.value", "column.millis", "column.quartiles", "column.error", "column.usual"]}
          rows={curve.points.map(({ knob, value, millis, lower, upper, error, isDefault }) => [knob, value, short(millis), `${short(lower)} – ${short(upper)}`, short(error), isDefault ? say("answer.yes") : ""])} />
      </details>
    </section>
  );
}

export default function Accuracy() {
  const [round, setRound] = useState(0);
  const learnt = useAsked(learn, EVERY_MILLIS, String(round));
  const table = learnt.data?.told.table;
  return (
    <>
      <Part title="system.accuracy" learnt={learnt}>
        {({ told, share }) => (
          <>
            <Measuring told={told} share={share} onAsked={() => setRound(round + 1)} />
            {!told.table && !BUSY.includes(told.state) && <p>{say("system.accuracy.none")}</p>}
          </>
        )}
      </Part>
      <Slider isPaused={BUSY.includes(learnt.data?.told.state ?? "")} />
      {table && <div class="curves">{curves(table).map((curve) => <OfStage key={curve.stage} curve={curve} />)}</div>}
    </>
  );
}
