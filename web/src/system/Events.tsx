// What happened before the cameras, narrowed down by camera, kind and time; older ones on demand.

import { useEffect, useState } from "preact/hooks";
import { api, content, told } from "../ask";
import type { components } from "../contract.gen";
import { Table, useAsked } from "../parts/parts";
import * as state from "../operate/state";
import { change, route, wayTo } from "../route";
import { say, sayWord } from "../strings";
import { OFTEN_MILLIS, Part, nameOf, when, yes } from "./Part";

type Event = components["schemas"]["Event"];

const KINDS = ["stopped", "left_behind", "taken_away", "light_changed", "frozen", "covered", "moved", "misaligned"];
const SPANS: Record<string, number> = { hour: 3_600e3, day: 86_400e3, all: Infinity };
const PAGE = 200;

/** A page of events, the newest first, and where older ones begin. */
async function ask(camera: string, span: string, cursor: string | null): Promise<{ events: Event[]; next: string | null }> {
  const millis = SPANS[span] ?? Infinity;
  // An event's id is the microsecond in which it was told.
  const after = Number.isFinite(millis) ? Math.round((Date.now() - millis) * 1e3) : 0;
  const query = { after, limit: PAGE, ...(camera ? { camera } : {}), ...(cursor === null ? {} : { cursor }) };
  const { events, next } = await content(api.GET("/api/v1/events", { params: { query } }));
  return { events: [...events].reverse(), next: next ?? null };
}

export default function Events() {
  const { camera = "", kind = "", span = "day" } = route.value.details;
  const key = `${camera} ${span}`;
  const learnt = useAsked(() => ask(camera, span, null), OFTEN_MILLIS, key);
  const [older, setOlder] = useState<{ key: string; events: Event[]; next: string | null } | null>(null);
  const [trouble, setTrouble] = useState("");
  useEffect(() => setOlder(null), [key]);
  const more = async (cursor: string) => {
    try {
      setTrouble("");
      const page = await ask(camera, span, cursor);
      setOlder({ key, events: [...(older?.events ?? []), ...page.events], next: page.next });
    } catch (error) {
      setTrouble(told(error));
    }
  };
  const shownOlder = older?.key === key ? older : null;
  return (
    <>
      <div class="choices filters">
        <label class="inline">{say("system.filter.camera")}{" "}
          <select value={camera} onChange={(event) => change({ camera: event.currentTarget.value || null })}>
            <option value="">{say("system.filter.all")}</option>
            {(state.cameras.value ?? []).map(({ id, name }) => <option key={id} value={id}>{name}</option>)}
          </select>
        </label>
        <label class="inline">{say("system.filter.kind")}{" "}
          <select value={kind} onChange={(event) => change({ kind: event.currentTarget.value || null })}>
            <option value="">{say("system.filter.all")}</option>
            {KINDS.map((word) => <option key={word} value={word}>{sayWord("event", word)}</option>)}
          </select>
        </label>
        <label class="inline">{say("system.filter.span")}{" "}
          <select value={span} onChange={(event) => change({ span: event.currentTarget.value === "day" ? null : event.currentTarget.value })}>
            {Object.keys(SPANS).map((word) => <option key={word} value={word}>{sayWord("system.span", word)}</option>)}
          </select>
        </label>
      </div>
      <Part title="system.events" learnt={learnt}>
        {(page) => {
          const newest = new Set(page.events.map(({ id }) => id));
          const all = [...page.events, ...(shownOlder?.events ?? []).filter(({ id }) => !newest.has(id))].filter((event) => kind === "" || event.kind === kind);
          const next = shownOlder ? shownOlder.next : page.next;
          return (
            <>
              <Table caption={say("system.events")} none={say("system.events.none")}
                columns={["column.time", "column.camera", "column.kind", "column.began", "column.over", "column.track"]}
                rows={all.map((event) => [
                  <a key="time" href={wayTo("operate", { at: event.time, camera: event.camera })}>{when(event.time)}</a>,
                  nameOf(event.camera), sayWord("event", event.kind), when(event.since), yes(event.is_end), event.track ?? "",
                ])} />
              {next !== null && <button type="button" onClick={() => void more(next)}>{say("system.older")}</button>}
              {trouble && <p class="wrong" role="alert">{trouble}</p>}
            </>
          );
        }}
      </Part>
    </>
  );
}
