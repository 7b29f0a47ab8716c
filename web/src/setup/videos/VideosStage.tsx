// The stage Videos: which cameras there are, what each shows, and that their clocks agree.

import { useEffect } from "preact/hooks";
import { CameraPicture } from "../../operate/CameraPicture";
import * as state from "../../operate/state";
import { Badge } from "../../parts/parts";
import { change, route } from "../../route";
import { say, sayWord } from "../../strings";
import { isSameCamera } from "../changes";
import { type DraftCamera, base, draft, edit, isReadOnly } from "../draft";
import { open } from "../faults";
import { CameraEditor } from "./CameraEditor";
import { KINDS, type Kind, withNewCamera } from "./edits";
import { Estimate } from "./Estimate";
import { Synchronise } from "./Synchronise";

const CARD_MILLIS = 2_000;

function choose(id: string | null, isStep = false): void {
  change({ camera: id }, isStep);
}

function add(kind: Kind): void {
  let added = "";
  edit(say("step.add"), (of) => {
    const { draft: next, id } = withNewCamera(of, kind);
    added = id;
    return next;
  });
  if (added) choose(added, true);
}

function AddButtons() {
  if (isReadOnly.value) return null;
  return (
    <div class="row" role="group" aria-label={say("videos.add")}>
      <span>{say("videos.add")}:</span>
      {KINDS.map((kind) => (
        <button key={kind} type="button" onClick={() => add(kind)}>{say(`videos.add.${kind}`)}</button>
      ))}
    </div>
  );
}

/** How a camera stands between draft and daemon, in one word. */
function badgeOf(camera: DraftCamera): { state: string; text: string } | null {
  const kept = base.value?.cameras.find(({ id }) => id === camera.id);
  if (open.value.some(({ document }) => document.kind === "camera" && document.id === camera.id)) return { state: "failed", text: say("videos.badge.fault") };
  if (!kept) return { state: "waiting", text: say("videos.badge.new") };
  if (!isSameCamera(kept, camera)) return { state: "waiting", text: say("videos.badge.changed") };
  if (!camera.isEnabled) return { state: "off", text: say("videos.badge.off") };
  const running = state.cameras.value?.find(({ id }) => id === camera.id);
  const word = running && state.stateOf(running);
  return word === undefined ? null : { state: word, text: sayWord("state", word) };
}

function CameraCard({ camera, isChosen }: { camera: DraftCamera; isChosen: boolean }) {
  const running = state.cameras.value?.find(({ id }) => id === camera.id);
  const badge = badgeOf(camera);
  return (
    <li>
      <button type="button" class="camera-choice" aria-pressed={isChosen} onClick={() => choose(camera.id, true)}>
        {running?.size_px && <span class="thumb"><CameraPicture camera={running} kind="frame" at={null} everyMillis={CARD_MILLIS} /></span>}
        <span class="camera-choice-name">{camera.name || say("videos.unnamed")}</span>
        {badge && <Badge {...badge} />}
      </button>
    </li>
  );
}

function Welcome() {
  return (
    <section class="card welcome">
      <h2>{say("videos.none")}</h2>
      {isReadOnly.value ? <p>{say("videos.none.readOnly")}</p> : <><p>{say("videos.none.help")}</p><AddButtons /><p class="quiet">{say("videos.none.next")}</p></>}
    </section>
  );
}

export default function VideosStage() {
  const cameras = draft.value?.cameras ?? [];
  const wanted = route.value.details["camera"];
  const idx = Math.max(0, cameras.findIndex(({ id }) => id === wanted));
  const chosen = cameras[idx];
  // What an undone step took away is not chosen any more.
  useEffect(() => {
    if (wanted !== undefined && chosen?.id !== wanted) choose(chosen?.id ?? null);
  }, [wanted, chosen?.id]);
  if (!chosen) return <Welcome />;
  return (
    <div class="videos">
      <div class="videos-list">
        <h2>{say("videos.list")}</h2>
        <ul>{cameras.map((camera, i) => <CameraCard key={i} camera={camera} isChosen={camera === chosen} />)}</ul>
        <AddButtons />
      </div>
      <div class="videos-main">
        <CameraEditor key={idx} camera={chosen} onId={(id) => choose(id)} />
        {!isReadOnly.value && <Synchronise />}
        {!isReadOnly.value && <Estimate />}
      </div>
    </div>
  );
}
