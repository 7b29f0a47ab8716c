// Which part of a file is played, what follows it, and when it was recorded.

import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { type DraftCamera, type Source, editCamera } from "../draft";
import { NumberField } from "../Fields";
import { without } from "../without";
import { withEnd, withPace } from "./edits";
import { Scrubber } from "./Scrubber";

/** The source with another part; ends that are the file's own are not named. */
function withPart(source: Source, from: number, until: number, length: number | null): Source {
  const rest = without(source, "from_secs", "until_secs");
  const isToEnd = length !== null && until >= length - 0.005;
  return { ...rest, ...(from > 0.0005 ? { from_secs: from } : {}), ...(isToEnd || !Number.isFinite(until) ? {} : { until_secs: until }) };
}

/** An instant as the browser's own field has it, in this machine's time zone. */
function localTime(instant: string | undefined): string {
  const millis = instant === undefined ? NaN : Date.parse(instant);
  if (!Number.isFinite(millis)) return "";
  return new Date(millis - new Date(millis).getTimezoneOffset() * 60_000).toISOString().slice(0, -1);
}

export function PartFields({ camera, length, rateHz, at, onAt, isDisabled }: {
  camera: DraftCamera;
  /** Seconds; null where the file does not say. */
  length: number | null;
  rateHz: number | null;
  at: number;
  onAt: (secs: number) => void;
  isDisabled: boolean;
}) {
  const name = camera.name || camera.id;
  const { source } = camera;
  const from = source.from_secs ?? 0;
  const until = source.until_secs ?? length ?? Infinity;
  const setPart = (next: number, end: number) =>
    editCamera(camera.id, say("step.part", { name }), (of) => ({ ...of, source: withPart(of.source, next, end, length) }), `part ${camera.id}`);
  const change = (label: string, change: (of: Source) => Source) => editCamera(camera.id, label, (of) => ({ ...of, source: change(of.source) }));
  return (
    <fieldset class="part">
      <legend>{say("videos.part")}</legend>
      {length !== null && (
        <>
          <Scrubber length={length} from={Math.min(from, length)} until={Math.min(until, length)} at={at} rateHz={rateHz} isDisabled={isDisabled} onAt={onAt}
            onPart={(next, end) => {
              onAt(next === from ? end : next);
              setPart(next, end);
            }} />
          <p class="quiet">{say("videos.part.help")}</p>
        </>
      )}
      <div class="row">
        <NumberField label={say("videos.part.from")} unit="s" value={source.from_secs ?? null} isOptional min={0} max={length ?? 1e7}
          onChange={(value) => setPart(value ?? 0, until)} />
        <NumberField label={say("videos.part.until")} unit="s" value={source.until_secs ?? null} isOptional min={0} max={length ?? 1e7}
          onChange={(value) => setPart(from, value ?? Infinity)} />
        {length !== null && (
          <>
            <button type="button" disabled={at >= until} onClick={() => setPart(at, until)}>{say("videos.part.fromHere")}</button>
            <button type="button" disabled={at <= from} onClick={() => setPart(from, at)}>{say("videos.part.untilHere")}</button>
          </>
        )}
        <button type="button" disabled={from === 0 && source.until_secs === undefined} onClick={() => setPart(0, Infinity)}>{say("videos.part.whole")}</button>
      </div>
      <div class="row">
        <span>{say("videos.end")}</span>
        <Segments name="source-end" label={say("videos.end")} values={["loop", "stop"]} chosen={source.end ?? "stop"} text={(value) => say(`videos.end.${value}`)}
          onChoose={(value) => change(say("step.end", { name }), (of) => withEnd(of, value))} />
        <span>{say("videos.pace")}</span>
        <Segments name="source-pace" label={say("videos.pace")} values={["real_time", "all"]} chosen={source.pace ?? "real_time"} text={(value) => say(`videos.pace.${value}`)}
          onChoose={(value) => change(say("step.pace", { name }), (of) => withPace(of, value))} />
        <label class="field">
          {say("videos.start")}
          <input type="datetime-local" step="0.001" value={localTime(source.start)} aria-describedby="start-hint"
            onChange={(event) => {
              const { value } = event.currentTarget;
              change(say("step.start", { name }), (of) => (value === "" ? without(of, "start") : { ...of, start: new Date(value).toISOString() }));
            }} />
          <span id="start-hint" class="quiet">{say("videos.start.hint")}</span>
        </label>
      </div>
    </fieldset>
  );
}
