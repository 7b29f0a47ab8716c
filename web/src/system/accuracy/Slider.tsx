// From fast to exact: what a setting is expected to take and to leave of error, and how it looks; or a deadline, for which the daemon
// chooses the settings.

import { useEffect, useId, useState } from "preact/hooks";
import { told } from "../../ask";
import { Segments, Table } from "../../parts/parts";
import { printed } from "../../operate/orbit";
import * as state from "../../operate/state";
import { say, sayWord } from "../../strings";
import { Example as Pictures } from "./Example";
import { type Looked, type Parameters, type Setting, planned, settings } from "./settings";

const WAYS = ["setting", "deadline"] as const;
const DEADLINE_MILLIS = [10, 5_000] as const;
const SETTLE_MILLIS = 150;

/** What Operate looks at. */
function looked(): Looked | null {
  const scene = state.scene.value;
  if (!scene) return null;
  const view = state.view.value ? printed(state.view.value) : {};
  const t = state.at.value === null ? {} : { t: new Date(state.at.value).toISOString() };
  return { scene: scene.id, view: { ...view, entities: state.entities.value, see_through: state.seeThrough.value, colors: state.colors.value, ...t } };
}

function Expected({ setting }: { setting: Setting }) {
  const { millis, upperMillis, error, basis } = setting;
  return (
    <p role="status">
      {millis === null ? say("system.slider.noTime") : say("system.slider.time", { ms: millis.toFixed(0), upper: (upperMillis ?? millis).toFixed(0) })}{" "}
      {error === null ? say("system.slider.noError") : say("system.slider.error", { error: error.toFixed(1) })}{" "}
      <span class="quiet">{sayWord("system.basis", basis)}</span>
    </p>
  );
}

/** A slider over milliseconds, even in their ratios. */
const fromSlider = (place: number) => Math.round(DEADLINE_MILLIS[0] * (DEADLINE_MILLIS[1] / DEADLINE_MILLIS[0]) ** place);

/** The pictures; none while it is being measured, which waits until nobody asks for any. */
function Example({ isPaused, ...given }: { looked: Looked; parameters: Parameters; title: string; isPaused: boolean }) {
  return isPaused ? <p class="quiet">{say("system.example.paused")}</p> : <Pictures {...given} />;
}

function ByDeadline({ view, isPaused }: { view: Looked; isPaused: boolean }) {
  const id = useId();
  const [place, setPlace] = useState(0.7);
  const [setting, setSetting] = useState<Setting | null>(null);
  const [trouble, setTrouble] = useState("");
  const millis = fromSlider(place);
  useEffect(() => {
    let isGone = false;
    const timer = setTimeout(() => {
      planned("deadline", { deadline_ms: String(millis) }, view).then(
        (found) => {
          if (isGone) return;
          setSetting(found);
          setTrouble("");
        },
        (error: unknown) => {
          if (isGone) return;
          setSetting(null);
          setTrouble(told(error));
        },
      );
    }, SETTLE_MILLIS);
    return () => {
      isGone = true;
      clearTimeout(timer);
    };
  }, [millis, JSON.stringify(view)]);
  return (
    <>
      <div class="slider">
        <label for={id}>{say("system.slider.deadline", { ms: millis })}</label>
        <input id={id} type="range" min={0} max={1} step={0.01} value={place} aria-valuetext={`${millis} ms`} onInput={(event) => setPlace(Number(event.currentTarget.value))} />
      </div>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
      {setting && (
        <>
          <Expected setting={setting} />
          <p class="quiet">{Object.entries(setting.knobs).map(([name, value]) => `${name.replaceAll("_", " ")}: ${String(value)}`).join(", ")}</p>
          {/* The knobs as they were chosen: what waits beside it would otherwise decide anew for each picture. */}
          <Example isPaused={isPaused} looked={view} parameters={Object.fromEntries(Object.entries(setting.knobs).map(([name, value]) => [name, String(value)]))} title={say("system.slider.within", { ms: millis })} />
        </>
      )}
    </>
  );
}

function BySetting({ view, isPaused }: { view: Looked; isPaused: boolean }) {
  const id = useId();
  const [all, setAll] = useState<readonly Setting[]>([]);
  const [place, setPlace] = useState<number | null>(null);
  const [trouble, setTrouble] = useState("");
  useEffect(() => {
    let isGone = false;
    settings(view).then((found) => !isGone && setAll(found), (error: unknown) => !isGone && setTrouble(told(error)));
    return () => {
      isGone = true;
    };
  }, [JSON.stringify(view)]);
  const at = Math.min(place ?? Math.max(all.findIndex(({ key }) => key === "draft"), 0), all.length - 1);
  const setting = all[at];
  if (!setting) return trouble ? <p class="wrong" role="alert">{trouble}</p> : <p class="quiet">{say("place.loading")} …</p>;
  const name = sayWord("system.setting", setting.key);
  return (
    <>
      <div class="slider">
        <label for={id}>{say("system.slider.label")}</label>
        <div class="slider-ends" aria-hidden="true"><span>{say("system.slider.fast")}</span><strong>{name}</strong><span>{say("system.slider.exact")}</span></div>
        <input id={id} type="range" min={0} max={all.length - 1} step={1} value={at} aria-valuetext={name} onInput={(event) => setPlace(Number(event.currentTarget.value))} />
      </div>
      <Expected setting={setting} />
      <Example isPaused={isPaused} looked={view} parameters={setting.parameters} title={name} />
      <details class="more">
        <summary>{say("system.slider.table")}</summary>
        <Table caption={say("system.slider.table")} none="" columns={["column.setting", "column.expected", "column.error"]}
          rows={all.map(({ key, millis, error }) => [sayWord("system.setting", key), millis === null ? "–" : `${millis.toFixed(0)} ms`, error === null ? "–" : error.toFixed(1)])} />
      </details>
    </>
  );
}

export function Slider({ isPaused }: { isPaused: boolean }) {
  const [way, setWay] = useState<(typeof WAYS)[number]>("setting");
  const view = looked();
  if (!view) return null;
  return (
    <section class="card" aria-label={say("system.slider")}>
      <h2>{say("system.slider")}</h2>
      <p class="quiet">{say("system.slider.help")}</p>
      <Segments name="slider-way" label={say("system.slider.way")} values={WAYS} chosen={way} text={(value) => say(`system.slider.by.${value}`)} onChoose={setWay} />
      {way === "setting" ? <BySetting view={view} isPaused={isPaused} /> : <ByDeadline view={view} isPaused={isPaused} />}
    </section>
  );
}
