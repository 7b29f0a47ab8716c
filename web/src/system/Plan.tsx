// The plan of the view on Operate: what is drawn and why, what it is expected to take, and what it took.

import { useState } from "preact/hooks";
import { address, api, ask, content, told } from "../ask";
import { Facts, Table, useAsked } from "../parts/parts";
import { printed } from "../operate/orbit";
import * as state from "../operate/state";
import { wayTo } from "../route";
import { type Key, say, sayWord } from "../strings";
import { OFTEN_MILLIS, Part, nameOf, when, yes } from "./Part";
import { type Stages, drawnIn, stages } from "./timing";

/** What Operate asks for, but for size and time. */
function query() {
  return {
    entities: state.entities.value, quality: state.quality.value, see_through: state.seeThrough.value, colors: state.colors.value,
    ...(state.view.value ? { ...printed(state.view.value), fov: state.view.value.fov } : {}),
    ...(state.at.value === null ? {} : { t: new Date(state.at.value).toISOString() }),
  };
}

type Drawn = { stages: Stages; cache: string; settings: string };

/** Draws the view once, and tells what it took. */
function Measured({ scene }: { scene: string }) {
  const [drawn, setDrawn] = useState<Drawn | null>(null);
  const [trouble, setTrouble] = useState("");
  const [isBusy, setBusy] = useState(false);
  const draw = async () => {
    setBusy(true);
    try {
      setTrouble("");
      const response = await ask(address(`/api/v1/scenes/${encodeURIComponent(scene)}/view.jpg`, { ...query(), width: 1280, height: 720 }));
      await response.arrayBuffer();
      setDrawn({
        stages: stages(response.headers.get("server-timing")), cache: response.headers.get("videofields-cache") ?? "", settings: response.headers.get("videofields-settings") ?? "",
      });
    } catch (error) {
      setTrouble(told(error));
    }
    setBusy(false);
  };
  const facts = drawn?.stages.map(({ name, millis }) => [sayWord("stage", name), `${millis.toFixed(1)} ms`] as const) ?? [];
  return (
    <>
      <div class="choices">
        <button type="button" disabled={isBusy} onClick={() => void draw()}>{say("system.plan.draw")}</button>
        {drawn && <p role="status">{say(drawn.cache === "hit" ? "system.plan.kept" : "system.plan.took", { ms: drawnIn(drawn.stages).toFixed(0) })}</p>}
      </div>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
      {facts.length > 0 && <dl class="facts">{facts.map(([name, value]) => <div key={name}><dt>{name}</dt><dd>{value}</dd></div>)}</dl>}
    </>
  );
}

export default function Plan() {
  const scene = state.scene.value;
  const learnt = useAsked(async () => {
    if (!scene) return undefined;
    return content(api.GET("/api/v1/scenes/{id}/plan", { params: { path: { id: scene.id }, query: { ...query(), width: 1280, height: 720 } } }));
  }, OFTEN_MILLIS, scene?.id);
  if (!scene) return <p class="quiet">{say("system.plan.noScene")}</p>;
  const names = (ids: readonly string[]) => ids.map(nameOf).join(", ") || say("system.plan.nobody");
  return (
    <>
      <Part title="system.plan" learnt={learnt}>
        {(plan) => plan && (
          <>
            <p class="quiet">
              {say("system.plan.of", { scene: scene.name, time: when(plan.time), width: plan.size_px[0] ?? 0, height: plan.size_px[1] ?? 0 })}{" "}
              <a href={wayTo("operate")}>{say("system.plan.operate")}</a>
            </p>
            {plan.expected_ms !== null && plan.expected_upper_ms !== null && (
              <p>
                {say("system.plan.expected", { ms: plan.expected_ms.toFixed(0), upper: plan.expected_upper_ms.toFixed(0) })}{" "}
                {sayWord("system.basis", plan.expected_by ?? "guess")}{" "}
                {plan.expected_error !== null && say("system.plan.error", { error: plan.expected_error.toFixed(1) })}
              </p>
            )}
            <Measured scene={scene.id} />
            <Table caption={say("system.plan")} none="" columns={["column.effect", "column.on", "column.reason"]}
              rows={plan.effects.map(({ effect, is_on, because }) => [effect.replaceAll("_", " "), yes(is_on), because])} />
          </>
        )}
      </Part>
      <Part title="system.plan.who" learnt={learnt}>
        {(plan) => plan && (
          <>
            <Facts facts={[
              ["system.plan.surfaces", names(plan.surface_cameras)],
              ["system.plan.depths", names(plan.depth_map_cameras)],
              ["system.plan.people", names(plan.entity_cameras)],
              ["system.plan.gaps", names(plan.gaps)],
              ["system.plan.opened", plan.opened.length],
              ["system.plan.parts", plan.parts],
            ] satisfies readonly (readonly [Key, string | number])[]} />
            <Table caption={say("system.plan.entities")} none={say("system.plan.entities.none")} columns={["column.position", "column.shown", "column.seen"]}
              rows={plan.entities.map(({ foot_m, shown_from, seen_by }) => [foot_m.map((metres) => metres.toFixed(2)).join(", "), nameOf(shown_from), names(seen_by)])} />
            <Table caption={say("system.plan.settings")} none="" columns={["column.setting", "column.value", "column.leftOut"]}
              rows={Object.entries(plan.settings).map(([name, value]) => [name.replaceAll("_", " "), value, yes(plan.left_out.includes(name))])} />
          </>
        )}
      </Part>
    </>
  );
}
