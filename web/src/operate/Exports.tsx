// Clips of what was recorded: a part of time that is picked on the timeline, cameras, how far each export is, and its files.

import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { api, change, content } from "../ask";
import type { components } from "../contract.gen";
import { useAsked } from "../parts/parts";
import { say, sayWord } from "../strings";
import { bytes, clock, duration } from "../units";
import * as clockwork from "./clockwork";
import { instant, millisOf, typed } from "./moments";
import { allowed, mayRemove } from "./rights";
import { explained } from "./Snapshots";
import * as state from "./state";

type Export = components["schemas"]["Export"];

const RUNNING_MILLIS = 1_000;
const AGAIN_MILLIS = 15_000;
/** What is chosen at first: this much before what is shown. */
const FIRST_MILLIS = 30_000;
const asked = signal(0);

function End({ end }: { end: "from" | "to" }) {
  const range = clockwork.range.value;
  const [text, setText] = useState<string | null>(null);
  const [isWrong, setWrong] = useState(false);
  if (!range) return null;
  const take = () => {
    if (text === null) return;
    const read = typed(text, range[end]);
    const next = "millis" in read ? { ...range, [end]: read.millis } : null;
    const isRight = next !== null && next.to > next.from;
    setWrong(!isRight);
    if (!isRight) return;
    clockwork.range.value = next;
    setText(null);
  };
  return (
    <label>
      {say(`export.${end}`)}
      <input class="moment" spellcheck={false} value={text ?? clock(range[end], true)} aria-invalid={isWrong} title={say("time.entry.title")}
        onInput={(event) => setText(event.currentTarget.value)} onBlur={take}
        onKeyDown={(event) => {
          if (event.key === "Enter") take();
          event.stopPropagation();
        }} />
      {isWrong && <span class="reason" role="alert">{say("export.wrong")}</span>}
    </label>
  );
}

function Form({ cameras }: { cameras: readonly string[] }) {
  const [left, setLeft] = useState<ReadonlySet<string>>(new Set());
  const [isBlurred, setBlurred] = useState(false);
  const [note, setNote] = useState("");
  const [failure, setFailure] = useState<string | null>(null);
  const [isBusy, setBusy] = useState(false);
  const range = clockwork.range.value;
  useEffect(() => {
    const shown = clockwork.shownTime();
    clockwork.range.value = { from: shown - FIRST_MILLIS, to: shown };
    return () => {
      clockwork.range.value = null;
    };
  }, []);
  if (!range) return null;
  const chosen = cameras.filter((camera) => !left.has(camera));
  const go = async () => {
    setBusy(true);
    setFailure(null);
    const body = { from: instant(range.from), to: instant(range.to), cameras: chosen, note, ...(isBlurred ? { blur_people: {} } : {}) };
    try {
      await change<Export>("POST", "/api/v1/exports", body, { headers: { "Idempotency-Key": crypto.randomUUID() } });
      asked.value += 1;
      setNote("");
    } catch (error) {
      setFailure(explained(error));
    }
    setBusy(false);
  };
  return (
    <form class="keep-form" onSubmit={(event) => {
      event.preventDefault();
      void go();
    }}>
      <div class="ends"><End end="from" /><End end="to" /></div>
      <p class="quiet">{say("export.length", { length: duration((range.to - range.from) / 1e3) })}</p>
      <fieldset>
        <legend>{say("cameras.title")}</legend>
        {cameras.map((camera) => (
          <label key={camera} class="inline">
            <input type="checkbox" checked={!left.has(camera)} onChange={(event) => {
              const next = new Set(left);
              if (event.currentTarget.checked) next.delete(camera);
              else next.add(camera);
              setLeft(next);
            }} /> {state.nameOf(camera)}
          </label>
        ))}
      </fieldset>
      <label class="inline"><input type="checkbox" checked={isBlurred} onChange={(event) => setBlurred(event.currentTarget.checked)} /> {say("keep.blur")}</label>
      <label>{say("keep.note")}<textarea rows={2} maxLength={1000} value={note} onInput={(event) => setNote(event.currentTarget.value)} /></label>
      <button type="submit" class="is-main" disabled={isBusy || chosen.length === 0}>{say("export.do")}</button>
      {failure !== null && <p class="reason" role="alert">{failure}</p>}
    </form>
  );
}

function Row({ one }: { one: Export }) {
  const [isSure, setSure] = useState(false);
  const [failure, setFailure] = useState<string | null>(null);
  const isOver = one.state === "done" || one.state === "failed";
  const path = `/api/v1/exports/${encodeURIComponent(one.id)}`;
  const remove = async () => {
    try {
      await change("DELETE", path);
      asked.value += 1;
    } catch (error) {
      setFailure(explained(error));
    }
  };
  return (
    <li class="export" data-state={one.state}>
      <span><b>{one.note || clock(millisOf(one.from))}</b> <span class="quiet">{clock(millisOf(one.from)).slice(11)} – {clock(millisOf(one.to)).slice(11)} · {one.cameras.map(state.nameOf).join(", ")}</span></span>
      {!isOver && <progress max={1} value={one.progress} aria-label={say("export.progress")}>{Math.round(one.progress * 100)} %</progress>}
      <span class="quiet">{sayWord("export.state", one.state)}{one.reason !== null ? `: ${one.reason}` : ""}{one.state === "done" ? ` · ${bytes(one.bytes)}` : ""}</span>
      {one.files.length > 0 && (
        <ul class="files">
          {one.files.map((file) => (
            <li key={file.file}><a href={`${path}/${encodeURIComponent(file.file)}`} download={file.file}>{file.file}</a> <span class="quiet">{bytes(file.bytes)}</span></li>
          ))}
        </ul>
      )}
      {mayRemove(one) && (
        <span class="pair">
          {isSure || !isOver
            ? <button type="button" class={isOver ? "is-bad" : ""} onClick={() => void remove()}>{say(isOver ? "export.remove.do" : "export.cancel")}</button>
            : <button type="button" onClick={() => setSure(true)}>{say("export.remove")}</button>}
          {isSure && <button type="button" onClick={() => setSure(false)}>{say("answer.cancel")}</button>}
        </span>
      )}
      {failure !== null && <p class="reason" role="alert">{failure}</p>}
    </li>
  );
}

export function Exports() {
  const [isOpen, setOpen] = useState(false);
  const [isRunning, setRunning] = useState(false);
  const every = isRunning ? RUNNING_MILLIS : AGAIN_MILLIS;
  const learnt = useAsked(() => content(api.GET("/api/v1/exports", {})), every, String(asked.value));
  const exports = [...(learnt.data?.exports ?? [])].reverse();
  const isAny = exports.some(({ state: word }) => word === "waiting" || word === "running");
  useEffect(() => setRunning(isAny), [isAny]);
  const cameras = allowed("export");
  const isRecorded = state.cameras.value?.some(({ recording }) => recording !== null) ?? false;
  return (
    <section aria-label={say("export.title")}>
      <h2>{say("export.title")}</h2>
      {cameras.length === 0 && <p class="quiet">{say("export.notAllowed")}</p>}
      {cameras.length > 0 && !isRecorded && <p class="quiet">{say("export.nothingRecorded")}</p>}
      {cameras.length > 0 && isRecorded && (
        <>
          <button type="button" aria-expanded={isOpen} onClick={() => setOpen(!isOpen)}>{say(isOpen ? "export.close" : "export.open")}</button>
          {isOpen && <p class="quiet">{say("export.help")}</p>}
          {isOpen && <Form cameras={cameras} />}
        </>
      )}
      {learnt.failure !== undefined && <p class="reason" role="status">{learnt.failure}</p>}
      <ul class="list">{exports.map((one) => <Row key={one.id} one={one} />)}</ul>
    </section>
  );
}
