// The four stages: where one is, how far each is and what it lacks, and the stage that is open. One that is not open is not loaded.

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { told } from "../ask";
import { print, route } from "../route";
import { say } from "../strings";
import { type Draft, draft } from "./draft";
import { STAGES, type Stage, open } from "./faults";
import { progress } from "./stages";

const LOADERS: Record<Stage, () => Promise<{ default: ComponentType }>> = {
  videos: () => import("./videos/VideosStage"),
  ground: () => import("./ground/GroundStage"),
  cameras: () => import("./cameras/CamerasStage"),
  geometry: () => import("./geometry/GeometryStage"),
};
const MARKS = { empty: "○", begun: "◐", done: "●" } as const;

const loaded = signal<Partial<Record<Stage, ComponentType>>>({});
const failed = signal<string | null>(null);

async function load(stage: Stage): Promise<void> {
  if (loaded.value[stage]) return;
  try {
    const { default: component } = await LOADERS[stage]();
    loaded.value = { ...loaded.value, [stage]: component };
    failed.value = null;
  } catch (error) {
    failed.value = told(error);
  }
}

/** The stage that the address names; the first where it names none. */
export function stageNow(): Stage {
  return STAGES.find((stage) => stage === route.value.details["stage"]) ?? "videos";
}

/** The address of a stage, with what of it is chosen. */
export function wayToStage(stage: Stage, details: Readonly<Record<string, string>> = {}): string {
  return print({ place: "setup", details: { ...route.value.details, stage, ...details } });
}

function StageLink({ of, stage, number }: { of: Draft; stage: Stage; number: number }) {
  const { state, missing } = progress(of, stage);
  const faults = open.value.filter((fault) => fault.stage === stage).length;
  const words = faults > 0 ? say("setup.stage.faults", { count: faults }) : missing.map((key) => say(`setup.missing.${key}`)).join(" ");
  return (
    <li>
      <a href={wayToStage(stage)} data-state={faults > 0 ? "fault" : state} aria-current={stageNow() === stage ? "step" : undefined}>
        <span class="stage-name">
          <span class="stage-mark" aria-hidden="true">{faults > 0 ? "!" : MARKS[state]}</span>
          {" "}{number}. {say(`setup.stage.${stage}`)}
          <span class="hidden"> ({say(`setup.state.${state}`)})</span>
        </span>
        <span class="stage-words">{words || say("setup.state.done")}</span>
      </a>
    </li>
  );
}

export function StageList() {
  const of = draft.value;
  if (!of) return null;
  return (
    <nav class="stages" aria-label={say("setup.stages")}>
      <ol>{STAGES.map((stage, i) => <StageLink key={stage} of={of} stage={stage} number={i + 1} />)}</ol>
    </nav>
  );
}

export function OpenStage() {
  const stage = stageNow();
  useEffect(() => void load(stage), [stage]);
  const Content = loaded.value[stage];
  const next = STAGES[STAGES.indexOf(stage) + 1];
  if (Content) {
    return (
      <>
        <Content />
        {next && <p class="next"><a href={wayToStage(next)}>{say("setup.next", { stage: say(`setup.stage.${next}`) })} <span aria-hidden="true">→</span></a></p>}
      </>
    );
  }
  if (failed.value === null) return <p class="quiet">{say("place.loading")} …</p>;
  return (
    <p class="trouble" role="alert">
      {say("place.failed")} <button type="button" onClick={() => location.reload()}>{say("place.again")}</button>
    </p>
  );
}
