// Who draws the fused view and why, in a line; and the choice of it, for the menu of the picture.

import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import * as state from "../state";
import { LEAST_RATE, choice, rate } from "./choose";

/** Who draws, and why. */
export function DrawnBy() {
  const { by, why } = choice.value;
  const values = { rate: Math.round(rate.value ?? 0), least: LEAST_RATE };
  return <p class="quiet" role="status" data-drawn-by={by} data-why={why}>{say(`spatial.by.${by}`)} {say(`spatial.why.${why}`, values)}</p>;
}

/** The choice of who draws. */
export function DrawingChoice() {
  return (
    <Segments name="drawing" label={say("spatial.drawing")} values={state.DRAWINGS} chosen={state.drawing.value}
      text={(value) => say(`spatial.drawing.${value}`)} onChoose={(value) => state.choose("drawing", value, "auto")} />
  );
}
