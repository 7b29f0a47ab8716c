// Every camera with its picture and how it fares; choosing one shows it alone.

import { Badge, Segments } from "../parts/parts";
import { say, sayWord } from "../strings";
import { duration } from "../units";
import { change } from "../route";
import { CameraPicture } from "./CameraPicture";
import { jumpInto } from "./jumping";
import * as state from "./state";

const CARD_MILLIS = 1_000;

/** What is said over the picture of a camera that does not show what is there now. */
export function saying(camera: state.Camera, word: string): string | null {
  if (word === "live" || word === "ended") return null;
  if (word === "frozen" || word === "stalled") return say(`camera.${word}`, { age: duration(sinceSecs(camera)) });
  if (word === "stale") return say("camera.stale", { age: duration(camera.age_secs ?? 0) });
  return word === "unknown" ? say("camera.unknown") : sayWord("state", word);
}

/** How long a camera has been in its state, as far as the clocks of daemon and browser agree. */
function sinceSecs(camera: state.Camera): number {
  return Math.max(0, (Date.now() - Date.parse(camera.since)) / 1e3);
}

function Card({ camera }: { camera: state.Camera }) {
  const word = state.stateOf(camera);
  const veil = saying(camera, word);
  const facts = camera.size_px
    ? [camera.size_px.join(" × "), say("camera.age", { age: duration(camera.age_secs ?? 0) })]
    : [say("camera.noFrame")];
  if (camera.recording) facts.push(sayWord("recording", camera.recording.state));
  const isOpened = state.openedCamera.value === camera.id;
  return (
    <article aria-label={camera.name} class={`camera ${isOpened ? "is-chosen" : ""}`} data-state={word} data-camera={camera.id}>
      <button type="button" class="picture" onClick={() => void jumpInto(camera.id)}>
        {/* Not a label, which would keep what is written over the picture from being read. */}
        <span class="hidden">{say("camera.open", { name: camera.name })}</span>
        <CameraPicture camera={camera} kind={state.kind.value} at={state.at.value} everyMillis={CARD_MILLIS} />
        {veil !== null && <span class="veil">{veil}</span>}
      </button>
      <header><h3>{camera.name}</h3><Badge state={word} text={sayWord("state", word)} /></header>
      {camera.reason !== null && camera.reason !== "" && <p class="reason">{camera.reason}</p>}
      <p class="quiet">{facts.join(" · ")}</p>
    </article>
  );
}

export function CameraList() {
  const cameras = state.cameras.value;
  const scene = state.scene.value;
  // Those of the scene first; a camera that is in none is still one to look after.
  const sorted = [...(cameras ?? [])].sort((a, b) => rank(a, scene) - rank(b, scene));
  const bad = sorted.filter((camera) => state.isTrouble(state.stateOf(camera))).length;
  return (
    <section class="cameras" aria-labelledby="cameras-title">
      <div class="cameras-bar">
        <h2 id="cameras-title">{say("cameras.title")}</h2>
        {cameras && cameras.length > 0 && (
          <Badge state={bad > 0 ? "stale" : "live"} text={bad > 0 ? say("cameras.trouble", { count: bad }) : say("cameras.fine")} />
        )}
        <Segments name="kind" label={say("kind.label")} values={state.KINDS} chosen={state.kind.value}
          text={(kind) => say(`kind.${kind}`)} onChoose={(kind) => change({ kind: kind === "frame" ? null : kind })} />
      </div>
      {cameras?.length === 0 && <p class="quiet">{say("cameras.none")}</p>}
      <div class="cards">{sorted.map((camera) => <Card key={camera.id} camera={camera} />)}</div>
    </section>
  );
}

function rank(camera: state.Camera, scene: state.Scene | null): number {
  return scene && camera.scenes.includes(scene.id) ? 0 : 1;
}
