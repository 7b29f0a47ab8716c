// The camera in the hand as numbers: where it stands, where it looks, how far it sees.

import { say } from "../../strings";
import type { Calibration } from "../draft";
import { NumberField } from "../Fields";
import { hold } from "./edits";
import { FOV_DEG, anglesOf, fovOf, pointedAt, standingAt, withAngles, withFov } from "./holding";
import * as now from "./now";
import { document } from "./scene";
import { extent, point } from "./torch";

function Angle({ of, name, most }: { of: Calibration; name: "heading_deg" | "tilt_deg" | "roll_deg"; most: readonly [number, number] }) {
  return (
    <NumberField label={say(`cameras.torch.${name}`)} hint={say(`cameras.torch.${name}.hint`)} unit="°" places={2} min={most[0]} max={most[1]} value={anglesOf(of)[name]}
      onChange={(value) => value !== null && hold(withAngles(of, { [name]: value }), `cameras:torch:${name}`)} />
  );
}

export function TorchPanel() {
  const of = now.shown.value;
  if (!of) return <p class="quiet">{say("cameras.torch.noPicture")}</p>;
  const place = point(of.position_m);
  const put = (i: number, value: number | null) => {
    if (value !== null) hold(standingAt(of, point(place.map((old, j) => (j === i ? value : old)))), `cameras:torch:place${i}`);
  };
  const { low, high, level_m } = extent(document.value);
  return (
    <div class="cal-panel">
      <div class="cal-column">
        <fieldset>
          <legend>{say("cameras.torch.place")}</legend>
          <div class="row top">
            {(["x", "y", "z"] as const).map((name, i) => (
              <NumberField key={name} label={say(`cameras.torch.${name}`)} unit="m" value={place[i] ?? 0} onChange={(value) => put(i, value)} />
            ))}
          </div>
        </fieldset>
        <fieldset>
          <legend>{say("cameras.torch.direction")}</legend>
          <div class="row top">
            <Angle of={of} name="heading_deg" most={[-360, 360]} />
            <Angle of={of} name="tilt_deg" most={[-90, 90]} />
            <Angle of={of} name="roll_deg" most={[-180, 180]} />
          </div>
        </fieldset>
        <fieldset>
          <legend>{say("cameras.torch.lens")}</legend>
          <div class="row top">
            <NumberField label={say("cameras.torch.fov")} hint={say("cameras.torch.fov.hint")} unit="°" places={2} min={FOV_DEG[0]} max={FOV_DEG[1]} value={fovOf(of)}
              onChange={(value) => value !== null && hold(withFov(of, value), "cameras:torch:fov")} />
          </div>
        </fieldset>
        <p>
          <button type="button" onClick={() => hold(pointedAt(of, [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, level_m]))}>{say("cameras.torch.middle")}</button>
          {" "}
          {!now.calibration.value && <button type="button" class="is-main" onClick={() => hold(of)}>{say("cameras.torch.here")}</button>}
        </p>
      </div>
      <div class="cal-column">
        <p>{say("cameras.torch.about")}</p>
        <p class="quiet">{say("cameras.torch.keys")}</p>
      </div>
    </div>
  );
}
