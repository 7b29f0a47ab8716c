// Which cameras see the marked place, the best one's picture with the place in it, and why the others do not.

import { api, content } from "../ask";
import { useAsked } from "../parts/parts";
import { say, sayWord } from "../strings";
import { CameraPicture } from "./CameraPicture";
import { jumpInto } from "./jumping";
import * as state from "./state";

type Answer = NonNullable<Awaited<ReturnType<typeof asked>>>;
type Seen = Answer["cameras"][number];

const AGAIN_MILLIS = 4_000;
const EVERY_MILLIS = 500;

function asked(scene: string, place: readonly number[]) {
  const point = place.map((metres) => metres.toFixed(3)).join(",");
  return content(api.GET("/api/v1/scenes/{id}/which-cameras", { params: { path: { id: scene }, query: { point } } }));
}

/** Why a camera does not see it, in words. */
function because(seen: Seen): string {
  const why = sayWord("which.why", seen.why ?? "");
  if (seen.why !== "hidden") return why;
  return say("which.hidden", { surface: sayWord("surface", seen.surface ?? ""), metres: (seen.hidden_after_m ?? 0).toFixed(1) });
}

function Best({ seen, camera }: { seen: Seen; camera: state.Camera }) {
  return (
    <button type="button" class="picture" aria-label={say("camera.open", { name: camera.name })} onClick={() => void jumpInto(camera.id)}>
      <CameraPicture key={camera.id} camera={camera} kind="frame" at={state.at.value} everyMillis={EVERY_MILLIS} />
      <span class="spot" style={{ left: `${(seen.u ?? 0) * 100}%`, top: `${(seen.v ?? 0) * 100}%` }} />
    </button>
  );
}

function Row({ seen }: { seen: Seen }) {
  const name = state.nameOf(seen.camera);
  return (
    <li data-sees={seen.sees} data-camera={seen.camera}>
      <span>
        <b>{name}</b>{" "}
        <span class="quiet">
          {seen.sees ? say("which.sees", { pixels: (seen.pixels_per_m ?? 0).toFixed(0), metres: (seen.distance_m ?? 0).toFixed(1) }) : because(seen)}
          {seen.state !== null && seen.state !== "live" ? ` · ${sayWord("state", seen.state)}` : ""}
        </span>
      </span>
      {seen.sees && <button type="button" aria-label={say("camera.open", { name })} onClick={() => void jumpInto(seen.camera)}>{say("which.open")}</button>}
    </li>
  );
}

export function WhichCameras() {
  const [mark, scene] = [state.mark.value, state.scene.value?.id];
  return mark && scene !== undefined ? <Told key={mark.join(",")} mark={mark} scene={scene} /> : null;
}

function Told({ mark, scene }: { mark: readonly number[]; scene: string }) {
  const learnt = useAsked(() => asked(scene, mark), AGAIN_MILLIS);
  const [x = 0, y = 0, z = 0] = mark;
  const cameras = learnt.data?.cameras ?? [];
  const count = cameras.filter(({ sees }) => sees).length;
  const best = cameras.find(({ sees }) => sees);
  const camera = state.cameras.value?.find(({ id }) => id === best?.camera);
  return (
    <section class="panel which" aria-label={say("which.title")}>
      <header>
        <h2>{say("which.title")}</h2>
        <button type="button" onClick={() => state.setMark(null)}>{say("which.close")}</button>
      </header>
      <p class="quiet">{say("which.place", { x: x.toFixed(2), y: y.toFixed(2), z: z.toFixed(2) })}</p>
      {learnt.failure !== undefined && <p class="reason" role="status">{learnt.failure}</p>}
      {learnt.data && <p role="status">{say(count === 0 ? "which.nobody" : "which.count", { count, all: cameras.length })}</p>}
      {best && camera && <Best seen={best} camera={camera} />}
      <ul class="list">{cameras.map((seen) => <Row key={seen.camera} seen={seen} />)}</ul>
    </section>
  );
}
