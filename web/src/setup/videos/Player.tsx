// A camera's picture at a chosen time, frame by frame: of a file by its own length, of a running camera by what the daemon remembers.

import { useEffect, useRef, useState } from "preact/hooks";
import { address, ask, send } from "../../ask";
import * as state from "../../operate/state";
import { say } from "../../strings";
import { clock } from "../../units";
import { type DraftCamera, base } from "../draft";
import { digits } from "../Fields";
import { type Newest, useNewest } from "../newest";
import { placeOf } from "./edits";
import { useLook } from "./look";
import { type SceneTime, type Way, timeOfFile, timeOfRunning } from "./moment";
import { timecode } from "./Scrubber";
import { Zoomed } from "./Zoomed";

const REST_MILLIS = 120;
const FINE_SECS = 2;
const USUAL_RATE_HZ = 25;
const STEP_SIGNS = { "-1": "−1 s", "-frame": "◀", frame: "▶", 1: "+1 s" } as const;
/** How far back from the newest frame a running camera is first looked at: that frame is remembered for long enough. */
const BACK_SECS = 2;

/** What is shown: where in its own time, and when in the scene's. `at` is what was asked for. */
type Shown = { readonly url: string; readonly secs: number; readonly size: readonly number[] | null };

type Played = {
  readonly shown: Newest<Shown>;
  readonly low: number;
  readonly high: number;
  readonly frameSecs: number;
  readonly text: (secs: number) => string;
};

function useFile(camera: DraftCamera | null, at: number): Played {
  const looked = useLook(camera ? placeOf(camera.source) : null, at);
  const { value } = looked;
  const facts = useRef({ high: 0, rate: USUAL_RATE_HZ });
  if (value) {
    const rate = value.rate_hz ?? USUAL_RATE_HZ;
    facts.current = { high: value.duration_secs === null ? facts.current.high : Math.max(0, value.duration_secs - 1 / rate), rate };
  }
  const shown = value && { url: value.url, secs: value.at_secs ?? at, size: value.size_px };
  return { shown: { ...looked, value: shown }, low: 0, high: facts.current.high, frameSecs: 1 / facts.current.rate, text: timecode };
}

function useRunning(camera: DraftCamera | null, at: number): Played {
  const running = state.cameras.value?.find(({ id }) => id === camera?.id);
  const shownUrl = useRef<string | null>(null);
  const question = async (signal: AbortSignal): Promise<Shown> => {
    const response = await ask(camera ? framePath(camera) : "", { t: new Date(at * 1e3).toISOString() }, { signal });
    const url = URL.createObjectURL(await response.blob());
    if (shownUrl.current) URL.revokeObjectURL(shownUrl.current);
    shownUrl.current = url;
    const time = Date.parse(response.headers.get("Videofields-Time") ?? "") / 1e3;
    return { url, secs: Number.isFinite(time) ? time : at, size: running?.size_px ?? null };
  };
  const shown = useNewest(camera ? `${camera.id} ${at}` : null, REST_MILLIS, question);
  const [first, last] = [running?.first, running?.last].map((time) => (time ? Date.parse(time) / 1e3 : at));
  return { shown, low: first ?? at, high: last ?? at, frameSecs: 1 / USUAL_RATE_HZ, text: (secs) => clock(secs * 1e3, true) };
}

const framePath = ({ id }: DraftCamera) => `/api/v1/cameras/${encodeURIComponent(id)}/frame.jpg`;

/** The time of the frame beside one that a running camera showed, before it (-1) or after it (1); null where there is none near.
 * Times are answered by the nearest frame, so the first other one is beside it if each is less than twice as far as the last. */
async function beside(camera: DraftCamera, secs: number, direction: -1 | 1): Promise<number | null> {
  for (let away = 0.01; away < 2; away *= 1.7) {
    const t = new Date((secs + direction * away) * 1e3).toISOString();
    const response = await send(address(framePath(camera), { t }), { method: "HEAD" });
    const time = Date.parse(response.headers.get("Videofields-Time") ?? "") / 1e3;
    if (!response.ok || !Number.isFinite(time)) return null;
    if (Math.abs(time - secs) > 0.0005) return time;
  }
  return null;
}

/** The newest time of a running camera that is worth a look; 0 of a file. */
export function firstLook(camera: DraftCamera, way: Way): number {
  if (way === "file") return camera.source.from_secs ?? 0;
  const last = state.cameras.peek()?.find(({ id }) => id === camera.id)?.last;
  return last ? Date.parse(last) / 1e3 - BACK_SECS : 0;
}

/** When in the scene's time, as the draft has the clocks, a frame is shown. */
function sceneTime(camera: DraftCamera, way: Way, secs: number): SceneTime {
  const kept = base.value?.cameras.find(({ id }) => id === camera.id);
  return way === "file" ? timeOfFile(camera, secs) : timeOfRunning(secs, kept?.clock ?? {}, camera.clock);
}

export function Player({ camera, way, at, onAt, onTime }: {
  camera: DraftCamera;
  way: Way;
  at: number;
  onAt: (secs: number) => void;
  /** Tells when the frame that is shown is; null while none is. */
  onTime: (time: SceneTime | null) => void;
}) {
  const name = camera.name || camera.id;
  const file = useFile(way === "file" ? camera : null, at);
  const running = useRunning(way === "running" ? camera : null, at);
  const { shown, low, high, frameSecs, text } = way === "file" ? file : running;
  const [middle, setMiddle] = useState(at);
  const time = shown.value ? sceneTime(camera, way, shown.value.secs) : null;
  useEffect(() => onTime(time), [time?.of, time?.secs]);
  const go = (secs: number) => onAt(Math.round(Math.min(Math.max(secs, low), Math.max(high, low)) * 1e3) / 1e3);
  const jump = (secs: number) => {
    setMiddle(secs);
    go(secs);
  };
  const seen = shown.value?.secs ?? at;
  const frame = async (direction: -1 | 1) => {
    const next = way === "file" ? null : await beside(camera, seen, direction).catch(() => null);
    jump(next ?? seen + direction * frameSecs);
  };
  const steps = [["-1", () => jump(at - 1)], ["-frame", () => frame(-1)], ["frame", () => frame(1)], ["1", () => jump(at + 1)]] as const;
  return (
    <div class="player" role="group" aria-label={say("sync.player", { name })}>
      <Zoomed name={name} url={shown.value?.url ?? null} size={shown.value?.size ?? null} alt={say("videos.look.alt", { name })} />
      {shown.trouble && <p class="fault" role="status">{shown.trouble.message}</p>}
      <p class="player-time">{text(seen)} <span class="quiet">{way === "file" ? `${digits(seen)} s` : ""}</span></p>
      <input type="range" min={low} max={high} step={frameSecs} value={at} aria-label={say("sync.position", { name })} aria-valuetext={text(at)}
        onInput={(event) => jump(event.currentTarget.valueAsNumber)} />
      <label class="fine">
        <span class="quiet">{say("sync.fine")}</span>
        <input type="range" min={-FINE_SECS} max={FINE_SECS} step={frameSecs / 4} value={at - middle} aria-valuetext={text(at)}
          onInput={(event) => go(middle + event.currentTarget.valueAsNumber)} />
      </label>
      <div class="row">
        {steps.map(([key, step]) => (
          <button key={key} type="button" title={say(`sync.step.${key}`)} onClick={() => void step()}>
            <span aria-hidden="true">{STEP_SIGNS[key]}</span><span class="hidden">{say(`sync.step.${key}`)}</span>
          </button>
        ))}
      </div>
    </div>
  );
}
