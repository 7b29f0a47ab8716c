// Keeping what is shown as evidence, and what was kept last.

import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { Trouble, api, change, content, told } from "../ask";
import type { components } from "../contract.gen";
import { useAsked } from "../parts/parts";
import { say } from "../strings";
import { bytes, clock } from "../units";
import { instant, millisOf } from "./moments";
import { printed } from "./orbit";
import { allowed, isOperator } from "./rights";
import * as state from "./state";

type Snapshot = components["schemas"]["Snapshot"];

const AGAIN_MILLIS = 15_000;
const LISTED = 8;
const SIZE = { width: 1_920, height: 1_080 } as const;
/** Changes when one was made, so that the list is asked for anew. */
const made = signal(0);

/** What a refusal means for who keeps things. */
export function explained(error: unknown): string {
  if (error instanceof Trouble && error.status === 507) return say("keep.full", { message: error.message });
  if (error instanceof Trouble && error.status === 403) return say("keep.forbidden", { message: error.message });
  return told(error);
}

/** What is on the screen, as a request for a snapshot of it. */
function wish(): object | null {
  const millis = state.at.peek() ?? state.shown.peek()?.millis;
  const opened = state.openedCamera.peek();
  if (millis === undefined) return null;
  if (opened !== undefined) return { camera: opened, t: instant(millis) };
  const scene = state.scene.peek();
  const view = state.view.peek() ?? state.shown.peek()?.view;
  if (!scene) return null;
  const parameters = new URLSearchParams({
    ...(view ? printed(view) : {}), t: instant(millis), width: String(SIZE.width), height: String(SIZE.height),
    entities: state.entities.peek(), see_through: state.seeThrough.peek(), colors: state.colors.peek(), quality: "exact", ...state.effects.peek(),
  });
  return { scene: scene.id, parameters: parameters.toString().replaceAll("%2C", ",").replaceAll("%3A", ":") };
}

function Row({ snapshot }: { snapshot: Snapshot }) {
  const path = `/api/v1/snapshots/${snapshot.id}`;
  return (
    <li>
      <span>
        <b>{snapshot.note || (snapshot.kind === "camera" ? state.nameOf(snapshot.subject) : snapshot.subject)}</b>{" "}
        <span class="quiet">{clock(millisOf(snapshot.time), true)} · {bytes(snapshot.bytes)}</span>
      </span>
      <span class="pair">
        <a href={`${path}/picture.png`} target="_blank" rel="noreferrer">{say("keep.picture")}</a>
        <a href={`${path}/archive.tar`} download={`snapshot-${snapshot.id.slice(0, 8)}.tar`}>{say("keep.archive")}</a>
        <a href={`${path}/verification`} target="_blank" rel="noreferrer">{say("keep.verify")}</a>
      </span>
    </li>
  );
}

export function Snapshots() {
  const [note, setNote] = useState("");
  const [tags, setTags] = useState("");
  const [isBlurred, setBlurred] = useState(false);
  const [isHeld, setHeld] = useState(false);
  const [isBusy, setBusy] = useState(false);
  const [failure, setFailure] = useState<string | null>(null);
  const [last, setLast] = useState<Snapshot | null>(null);
  const learnt = useAsked(() => content(api.GET("/api/v1/snapshots", { params: { query: { limit: LISTED } } })), AGAIN_MILLIS, String(made.value));
  const isAllowed = isOperator() && allowed("export").length > 0;
  const keep = async () => {
    const what = wish();
    if (!what) return;
    setBusy(true);
    setFailure(null);
    const words = tags.split(",").map((tag) => tag.trim()).filter(Boolean);
    const body = { ...what, note, tags: words, hold: isHeld, ...(isBlurred ? { blur_people: {} } : {}) };
    try {
      setLast(await change<Snapshot>("POST", "/api/v1/snapshots", body, { headers: { "Idempotency-Key": crypto.randomUUID() } }));
      setNote("");
      made.value += 1;
    } catch (error) {
      setFailure(explained(error));
    }
    setBusy(false);
  };
  return (
    <section aria-label={say("keep.snapshot")}>
      <h2>{say("keep.snapshot")}</h2>
      {isAllowed ? (
        <form class="keep-form" onSubmit={(event) => {
          event.preventDefault();
          void keep();
        }}>
          <label>{say("keep.note")}<textarea rows={2} maxLength={2000} value={note} onInput={(event) => setNote(event.currentTarget.value)} /></label>
          <label>{say("keep.tags")}<input value={tags} onInput={(event) => setTags(event.currentTarget.value)} /></label>
          <label class="inline"><input type="checkbox" checked={isBlurred} onChange={(event) => setBlurred(event.currentTarget.checked)} /> {say("keep.blur")}</label>
          <label class="inline"><input type="checkbox" checked={isHeld} onChange={(event) => setHeld(event.currentTarget.checked)} /> {say("keep.hold")}</label>
          <button type="submit" class="is-main" disabled={isBusy}>{say(isBusy ? "keep.busy" : "keep.do")}</button>
        </form>
      ) : <p class="quiet">{say("keep.notAllowed")}</p>}
      {failure !== null && <p class="reason" role="alert">{failure}</p>}
      {last && <p role="status">{say("keep.done")} <a href={`/api/v1/snapshots/${last.id}/picture.png`} target="_blank" rel="noreferrer">{say("keep.picture")}</a></p>}
      <ul class="list">{learnt.data?.snapshots.map((snapshot) => <Row key={snapshot.id} snapshot={snapshot} />)}</ul>
    </section>
  );
}
