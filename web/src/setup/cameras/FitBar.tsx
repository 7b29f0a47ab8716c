// How well the calibration fits, always on screen; and what was found, to be taken over or left.

import { type ComponentChildren } from "preact";
import { say } from "../../strings";
import { grade } from "./CameraChoice";
import { accept, forget } from "./edits";
import * as now from "./now";
import { poverty } from "./pairs";
import { answer, isTaken } from "./solving";

/** Metres as people measure such: centimetres where they are few. */
export function metres(of: number): string {
  return of < 1 ? say("cameras.cm", { n: (of * 100).toFixed(of < 0.1 ? 1 : 0) }) : say("cameras.m", { n: of.toFixed(2) });
}

function Errors() {
  const [fit, lens, pairs] = [now.fitted.value, now.lens.value, now.pairs.value];
  if (!lens || (!now.calibration.value && !now.proposal.value)) return <span class="quiet">{say("cameras.fit.none")}</span>;
  if (!fit || pairs.length === 0) return <span class="quiet">{say("cameras.fit.unchecked")}</span>;
  if (fit.rms_px === null || fit.rms_m === null) return <span class="cal-error" data-grade="failed">{say("cameras.fit.off")}</span>;
  return (
    <span class="cal-error" data-grade={grade(fit.rms_px)} data-rms={fit.rms_px}>
      <strong>{say("cameras.fit.px", { px: fit.rms_px.toFixed(1) })}</strong> · <strong>{metres(fit.rms_m)}</strong>
      {" "}{say(pairs.length === 1 ? "cameras.fit.over.one" : "cameras.fit.over", { n: pairs.length })}
    </span>
  );
}

/** How sure what was found is, if clicks are good to a pixel. */
function Certainty() {
  const of = answer.value;
  if (of.state !== "found") return null;
  const { position_deviation_m, direction_deviation_deg, focal_deviation_px } = of.certainty;
  const direction = direction_deviation_deg.toFixed(direction_deviation_deg < 1 ? 2 : 1);
  const focal = focal_deviation_px > 0 ? ` ${say("cameras.sure.focal", { px: focal_deviation_px.toFixed(1) })}` : "";
  return <span>{say("cameras.sure", { position: metres(position_deviation_m), direction })}{focal}</span>;
}

/** What makes the pairs poor, and what to do about it. */
function Poverty() {
  const [pairs, size] = [now.pairs.value, now.size.value];
  const poor = size && poverty(pairs, size);
  return poor ? <span>{say(`cameras.poor.${poor}`)}</span> : null;
}

function PairsSay(): ComponentChildren {
  const of = answer.value;
  switch (of.state) {
    case "missing": return <span>{say(now.calibration.value ? "cameras.missing.anew" : "cameras.missing", { pairs: say(of.n === 1 ? "cameras.pairs.one" : "cameras.pairs.some", { n: of.n }) })}</span>;
    case "working": return <span>{say("cameras.working")}</span>;
    case "refused": return (
      <span class="cal-refused">
        {say(`cameras.refused.${of.why}`)}{of.why === "other" ? ` ${of.message}` : ""}
      </span>
    );
    case "found": return <Certainty />;
  }
}

function Proposal() {
  const offered = now.proposal.value;
  const isOn = offered !== null && offered.camera === now.chosen.value?.id;
  if (!isOn) return null;
  return (
    <span class="cal-proposal">
      <span>{say(now.calibration.value ? "cameras.proposal.other" : "cameras.proposal.first")}</span>
      <button type="button" class="is-main" onClick={accept}>{say("cameras.proposal.take")}</button>
      <button type="button" onClick={() => (now.proposal.value = null)}>{say("cameras.proposal.leave")}</button>
    </span>
  );
}

export function FitBar() {
  const isPairs = now.how.value === "pairs";
  return (
    <section class="cal-fit" aria-label={say("cameras.fit")}>
      <div class="row">
        <Errors />
        {now.calibration.value && <button type="button" class="push" onClick={forget}>{say("cameras.forget")}</button>}
      </div>
      <div class="row" role="status" aria-live="polite">
        {isPairs && <PairsSay />}
        {isPairs && isTaken() && <span class="badge" data-state="live">{say("cameras.taken")}</span>}
        {isPairs && <Poverty />}
        <Proposal />
      </div>
    </section>
  );
}
