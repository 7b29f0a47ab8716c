// The draft's cameras: which is calibrated, how well, and which is looked at.

import { lensOf } from "../../spatial/lens";
import { say } from "../../strings";
import { type Draft, type DraftCamera, calibratingOf, calibrationOf, draft } from "../draft";
import { choose, chosen } from "./now";
import { fit } from "./pairs";

/** Errors in pixels from which a calibration is good, and from which something is wrong. */
const GOOD_PX = 2;
const BAD_PX = 5;

/** How well an error speaks of a calibration, as badges have it. */
export function grade(rms_px: number | null): "live" | "waiting" | "failed" {
  if (rms_px === null) return "failed";
  return rms_px <= GOOD_PX ? "live" : rms_px <= BAD_PX ? "waiting" : "failed";
}

type State = { readonly state: string; readonly text: string };

function stateOf(of: Draft, { id }: DraftCamera): State {
  const { pairs } = calibratingOf(of, id);
  const calibration = calibrationOf(of, id);
  const isMember = of.scene.document.cameras?.some((camera) => camera.id === id) ?? false;
  if (!calibration && isMember) return { state: "ended", text: say("cameras.state.file") };
  if (!calibration) return { state: "waiting", text: pairs.length > 0 ? say(pairs.length === 1 ? "cameras.state.begun.one" : "cameras.state.begun", { n: pairs.length }) : say("cameras.state.none") };
  if (pairs.length === 0) return { state: "live", text: say("cameras.state.unchecked") };
  const { rms_px } = fit(lensOf(calibration), pairs);
  return { state: grade(rms_px), text: rms_px === null ? say("cameras.state.off") : say("cameras.state.fits", { px: rms_px.toFixed(1) }) };
}

export function CameraChoice() {
  const of = draft.value;
  if (!of) return null;
  return (
    <nav class="cal-cameras" aria-label={say("cameras.list")}>
      <ul>
        {of.cameras.map((camera) => {
          const { state, text } = stateOf(of, camera);
          return (
            <li key={camera.id}>
              <button type="button" aria-pressed={camera.id === chosen.value?.id} data-camera={camera.id} onClick={() => choose(camera.id)}>
                <span>{camera.name || camera.id}</span>
                <span class="badge" data-state={state}>{text}</span>
              </button>
            </li>
          );
        })}
      </ul>
    </nav>
  );
}
