// One camera's own picture, large; a place chosen in it is found in the world and marked in the fused view.

import { useEffect, useRef, useState } from "preact/hooks";
import { api, content, told } from "../ask";
import { Badge } from "../parts/parts";
import { say, sayWord } from "../strings";
import { clock, duration } from "../units";
import { CameraPicture } from "./CameraPicture";
import { saying } from "./CameraList";
import { jumpOut } from "./jumping";
import * as state from "./state";

const ALONE_MILLIS = 150;
const STEPS: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

function tellShown(id: string, millis: number): void {
  state.shownAlone.value = { millis, frames: new Map([[id, millis]]), view: null };
}

async function locate(camera: state.Camera, [u, v]: readonly [number, number]): Promise<string> {
  const scene = state.scene.value;
  const isThere = scene !== null && camera.scenes.includes(scene.id);
  const query = { u: Number(u.toFixed(5)), v: Number(v.toFixed(5)), ...(isThere ? { scene: scene.id } : {}) };
  try {
    const place = await content(api.GET("/api/v1/cameras/{id}/locate", { params: { path: { id: camera.id }, query } }));
    const [x = 0, y = 0, z = 0] = place.point_m;
    state.setMark(isThere ? [x, y, z] : null);
    const text = say("locate.place", {
      x: x.toFixed(2), y: y.toFixed(2), z: z.toFixed(2),
      surface: sayWord("surface", place.surface), index: place.surface_idx,
      angle: ((place.theta_rad * 180) / Math.PI).toFixed(1), footprint: (place.footprint_m * 100).toFixed(1),
    });
    return place.reliable ? text : `${text}; ${say("locate.doubt")}`;
  } catch (error) {
    state.setMark(null);
    return told(error);
  }
}

export function CameraAlone({ id }: { id: string }) {
  const cameras = state.cameras.value ?? [];
  const index = cameras.findIndex((camera) => camera.id === id);
  const camera = cameras[index];
  const back = useRef<HTMLButtonElement>(null);
  const [place, setPlace] = useState<readonly [number, number] | null>(null);
  const [located, setLocated] = useState("");
  useEffect(() => {
    setPlace(null);
    setLocated("");
  }, [id]);
  useEffect(() => back.current?.focus({ preventScroll: true }), []);
  useEffect(() => () => {
    state.shownAlone.value = null;
  }, [id]);
  const beside = (step: number) => cameras[(index + step + cameras.length) % cameras.length]?.id ?? id;
  const choose = async (chosen: readonly [number, number]) => {
    if (!camera) return;
    setPlace(chosen);
    setLocated(await locate(camera, chosen));
  };
  const share = (value: number, start: number, extent: number) => Math.min(Math.max((value - start) / extent, 0), 1);
  const word = camera ? state.stateOf(camera) : "unknown";
  const veil = camera ? saying(camera, word) : null;
  return (
    <div class="alone" data-camera={id} data-time={state.shownAlone.value?.millis}>
      <div class="alone-bar">
        <button ref={back} type="button" onClick={jumpOut} title={say("camera.back.title")}>← {say("camera.back")}</button>
        <h3>{camera?.name ?? id}</h3>
        <Badge state={word} text={sayWord("state", word)} />
        {cameras.length > 1 && (
          <span class="pair">
            <button type="button" aria-label={say("camera.previous")} onClick={() => state.openCamera(beside(-1))}>‹</button>
            <button type="button" aria-label={say("camera.next")} onClick={() => state.openCamera(beside(1))}>›</button>
          </span>
        )}
      </div>
      {!camera && state.cameras.value && <p class="quiet">{say("camera.gone", { id })}</p>}
      {camera && (
        <>
          <div class="camera is-large" data-state={word}>
            <button type="button" class="picture"
              onClick={(event) => {
                // A click made by a key has no place of its own: the spot's is taken.
                const box = event.currentTarget.getBoundingClientRect();
                void choose(event.detail > 0
                  ? [share(event.clientX, box.left, box.width), share(event.clientY, box.top, box.height)]
                  : place ?? [0.5, 0.5]);
              }}
              onKeyDown={(event) => {
                const step = STEPS[event.key];
                if (!step) return;
                event.preventDefault();
                const [u, v] = place ?? [0.5, 0.5];
                setPlace([share(u + step[0] * 0.02, 0, 1), share(v + step[1] * 0.02, 0, 1)]);
              }}>
              <span class="hidden">{say("camera.locate", { name: camera.name })}</span>
              <CameraPicture key={id} camera={camera} kind={state.kind.value} at={state.at.value} everyMillis={ALONE_MILLIS} onShown={(millis) => tellShown(id, millis)} />
              {place && <span class="spot" style={{ left: `${place[0] * 100}%`, top: `${place[1] * 100}%` }} />}
              <Stamp />
              {veil !== null && <span class="veil">{veil}</span>}
            </button>
          </div>
          <p class="located" aria-live="polite">{located || say("camera.locate.help")}</p>
          <p class="quiet">{details(camera).join(" · ")}</p>
        </>
      )}
    </div>
  );
}

/** Which time is shown, and how old it is. */
function Stamp() {
  const millis = state.shownAlone.value?.millis;
  if (millis === undefined) return null;
  const isLive = state.at.value === null;
  return (
    <span class="stamp">
      <span class={isLive ? "is-live" : "is-past"}>{say(isLive ? "view.live" : "view.past")}</span>
      <time dateTime={new Date(millis).toISOString()}>{clock(millis, !isLive)}</time>
    </span>
  );
}

function details(camera: state.Camera): string[] {
  const facts = [];
  if (camera.size_px) facts.push(camera.size_px.join(" × "));
  facts.push(say("camera.frames", { frames: camera.frames }));
  if (camera.dropped > 0) facts.push(say("camera.dropped", { dropped: camera.dropped }));
  if (camera.age_secs !== null) facts.push(say("camera.age", { age: duration(camera.age_secs) }));
  facts.push(say("camera.since", { state: sayWord("state", camera.state), time: clock(Date.parse(camera.since)) }));
  if (camera.next_try !== null) facts.push(say("camera.nextTry", { time: clock(Date.parse(camera.next_try)) }));
  if (camera.privacy.zones > 0) facts.push(say("camera.zones", { zones: camera.privacy.zones }));
  if (camera.reason !== null && camera.reason !== "") facts.push(camera.reason);
  return facts;
}
