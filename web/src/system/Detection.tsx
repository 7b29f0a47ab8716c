// Stages of motion detection, camera by camera: which run, why, and what was set.

import { useState } from "preact/hooks";
import { change, told } from "../ask";
import type { components } from "../contract.gen";
import { Badge, type Learnt, Table } from "../parts/parts";
import { isOperator, may } from "../operate/rights";
import * as state from "../operate/state";
import { say, sayWord } from "../strings";
import { Part } from "./Part";

type Stage = components["schemas"]["Stage"];
type Choice = Stage["choice"];

/** Time in which a camera that was set says what then holds. */
const SETTLE_MILLIS = 6_000;

const CHOICES: readonly Choice[] = ["auto", "on", "off"];

/** Stages whose figures are shares, shown in percent. */
const isShare = (quantity: string) => quantity !== "shake_px";
const figure = (value: number, quantity: string) =>
  isShare(quantity) ? say("detection.percent", { n: Number((100 * value).toPrecision(2)) }) : say("detection.pixels", { n: Number(value.toPrecision(2)) });

function reason({ measured, on_above, off_below, quantity, choice }: Stage): string {
  const found = measured === null ? say("detection.unmeasured") : `${sayWord("detection.quantity", quantity)}: ${figure(measured, quantity)}`;
  // Noise has no limits: thresholds follow whatever it is. Where somebody chose, the figure decides nothing.
  if (quantity === "noise_share" || choice !== "auto") return found;
  return say("detection.reason", { found, on: figure(on_above, quantity), off: figure(off_below, quantity) });
}

/** Returns what is sent to choose, or nothing for a stage that is set otherwise. */
function patch(stage: Stage["stage"], choice: Choice): object | null {
  if (stage === "noise") return null;
  if (stage === "blinking") return { suppress_blinking: choice === "auto" ? null : choice === "on" };
  return { [stage]: choice };
}

function Chosen({ camera, stage: { stage, choice } }: { camera: state.Camera; stage: Stage }) {
  const [asked, setAsked] = useState<Choice | null>(null);
  const [trouble, setTrouble] = useState("");
  // One threshold for the whole picture leaves nothing to choose.
  const isFixed = camera.stages.some((of) => of.stage === "noise" && of.choice === "off");
  if (isFixed && (stage === "noise" || stage === "flicker")) return <>{say("detection.fixed")}</>;
  // The choice just made is shown until the camera confirms it.
  if (asked === choice) setAsked(null);
  if (patch(stage, "auto") === null || !isOperator() || !may("manage", camera.id)) return <>{sayWord("detection.choice", choice)}</>;
  const choose = async (next: Choice) => {
    setAsked(next);
    try {
      setTrouble("");
      // Other settings that were changed meanwhile stay.
      await change("PATCH", `/api/v1/cameras/${encodeURIComponent(camera.id)}/segment`, patch(stage, next), { tag: "*" });
      // A camera on which another setting forbids the choice never confirms it.
      setTimeout(() => setAsked(null), SETTLE_MILLIS);
    } catch (error) {
      setAsked(null);
      setTrouble(told(error));
    }
  };
  return (
    <>
      <select disabled={asked !== null} aria-label={say("detection.choose", { stage: sayWord("detection.stage", stage), camera: camera.name })} value={asked ?? choice}
        onChange={(event) => void choose(event.currentTarget.value as Choice)}>
        {CHOICES.map((word) => <option key={word} value={word}>{sayWord("detection.choice", word)}</option>)}
      </select>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </>
  );
}

/** A table of every camera's stages. */
export function Detection() {
  const learnt: Learnt<state.Camera[]> = state.cameras.value ? { data: state.cameras.value } : {};
  return (
    <Part title="detection.title" learnt={learnt}>
      {(cameras) => (
        <>
          <p class="quiet">{say("detection.help")}</p>
          <Table caption={say("detection.title")} none={say("detection.none")}
            columns={["column.camera", "column.stage", "column.state", "column.reason", "column.setting"]}
            rows={cameras.flatMap((camera) => camera.stages.map((of) => [
              camera.name,
              sayWord("detection.stage", of.stage),
              <Badge key="state" state={of.is_on ? "live" : "ended"} text={say(of.is_on ? "detection.runs" : "detection.rests")} />,
              reason(of),
              <Chosen key={`${camera.id} ${of.stage}`} camera={camera} stage={of} />,
            ]))} />
        </>
      )}
    </Part>
  );
}
