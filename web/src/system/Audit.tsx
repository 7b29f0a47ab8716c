// The audit log, the newest entries first, narrowed down by who, what and what came of it.

import { useEffect, useState } from "preact/hooks";
import { api, content, told } from "../ask";
import { Table } from "../parts/parts";
import { change, route } from "../route";
import { say } from "../strings";
import { when } from "./Part";

export type Entry = { number: number; at: string; user: string | null; action: string; target: string; status: number; digest: string };

const PAGE = 300;

async function after(number: number, limit: number): Promise<Entry[]> {
  const query = { limit, ...(number > 0 ? { cursor: String(number) } : {}) };
  return (await content(api.GET("/api/v1/audit", { params: { query } }))).entries;
}

/** The number of the last entry: numbers have no holes, and the log is told the oldest first; so it is looked for by halves. */
export async function lastNumber(isBeyond: (number: number) => Promise<boolean>): Promise<number> {
  let [low, high] = [0, 1_024];
  while (!(await isBeyond(high))) [low, high] = [high, high * 2];
  // At `low` something comes after (or it is 0), at `high` nothing does.
  while (high - low > 1) {
    const middle = Math.floor((low + high) / 2);
    if (await isBeyond(middle)) high = middle;
    else low = middle;
  }
  return high;
}

/** A page of entries, the newest first, that ends before `end` (null: with the last there is). */
async function page(end: number | null): Promise<{ entries: Entry[]; from: number }> {
  const last = end ?? (await lastNumber(async (number) => (await after(number, 1)).length === 0)) + 1;
  const from = Math.max(last - 1 - PAGE, 0);
  const entries = (await after(from, Math.max(last - 1 - from, 1))).filter(({ number }) => number < last);
  return { entries: entries.reverse(), from };
}

function matches({ user, action, target, status }: Entry, who: string, what: string, refused: boolean): boolean {
  const has = (text: string, part: string) => text.toLowerCase().includes(part.toLowerCase());
  return has(user ?? "", who) && (has(action, what) || has(target, what)) && (!refused || status >= 400);
}

export default function Audit() {
  const { who = "", what = "", refused } = route.value.details;
  const [learnt, setLearnt] = useState<{ entries: Entry[]; from: number } | null>(null);
  const [trouble, setTrouble] = useState("");
  const [isBusy, setBusy] = useState(false);
  const more = async (isAfresh: boolean) => {
    setBusy(true);
    try {
      setTrouble("");
      const next = await page(isAfresh ? null : (learnt?.from ?? 0) + 1);
      setLearnt({ entries: isAfresh ? next.entries : [...(learnt?.entries ?? []), ...next.entries], from: next.from });
    } catch (error) {
      setTrouble(told(error));
    }
    setBusy(false);
  };
  useEffect(() => void more(true), []);
  const shown = (learnt?.entries ?? []).filter((entry) => matches(entry, who, what, refused !== undefined));
  return (
    <section class="card">
      <h2>{say("system.audit")}</h2>
      <p class="quiet">{say("system.audit.help")}</p>
      <div class="choices filters">
        <label class="inline">{say("system.audit.who")}{" "}
          <input type="search" value={who} onInput={(event) => change({ who: event.currentTarget.value || null })} />
        </label>
        <label class="inline">{say("system.audit.what")}{" "}
          <input type="search" value={what} onInput={(event) => change({ what: event.currentTarget.value || null })} />
        </label>
        <label class="inline">
          <input type="checkbox" checked={refused !== undefined} onChange={(event) => change({ refused: event.currentTarget.checked ? "1" : null })} /> {say("system.audit.refused")}
        </label>
        <button type="button" disabled={isBusy} onClick={() => void more(true)}>{say("system.audit.again")}</button>
      </div>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
      {learnt === null ? !trouble && <p class="quiet">{say("place.loading")} …</p> : (
        <>
          <p class="quiet" role="status">{say("system.audit.shown", { n: shown.length, of: learnt.entries.length })}</p>
          <Table caption={say("system.audit")} none={say("system.audit.none")} columns={["column.number", "column.time", "column.user", "column.action", "column.target", "column.status"]}
            rows={shown.map((entry) => [
              entry.number, <span key="at" class="nowrap">{when(entry.at)}</span>, entry.user ?? say("system.audit.nobody"), <span key="action" class="long">{entry.action}</span>, <span key="target" class="long" title={entry.digest}>{entry.target}</span>, entry.status,
            ])} />
          {learnt.from > 0 && <button type="button" disabled={isBusy} onClick={() => void more(false)}>{say("system.older")}</button>}
        </>
      )}
    </section>
  );
}
