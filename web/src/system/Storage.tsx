// Storage: what is recorded and since when, how fast it grows, and what goes when.

import { api, ask, content } from "../ask";
import { Facts, Table, useAsked } from "../parts/parts";
import * as state from "../operate/state";
import { say, sayWord } from "../strings";
import { bytes, clock, duration } from "../units";
import { Part, SELDOM_MILLIS, nameOf } from "./Part";
import { type Metrics, parse, sum } from "./prometheus";

const DAY_SECS = 86_400;
/** Further back than anything is kept for. */
const LONG_AGO_MILLIS = 800 * DAY_SECS * 1e3;

/** Metrics where the caller may ask for them. */
async function metrics(): Promise<Metrics | null> {
  try {
    return parse(await (await ask("/metrics")).text());
  } catch {
    return null;
  }
}

type Span = { camera: string; first: number; last: number; secs: number; gaps: number };

/** From when to when each camera can be shown, in all scenes. */
async function spans(): Promise<Span[]> {
  const query = { from: new Date(Date.now() - LONG_AGO_MILLIS).toISOString(), to: new Date().toISOString(), resolution: DAY_SECS };
  const told = await Promise.all((state.scenes.value ?? []).map(({ id }) => content(api.GET("/api/v1/scenes/{id}/timeline", { params: { path: { id }, query } }))));
  const byCamera = new Map(told.flatMap(({ cameras }) => cameras.map(({ camera, ranges }) => [camera, ranges] as const)));
  return [...byCamera].map(([camera, ranges]) => {
    const times = ranges.map(([from = "", to = ""]) => [Date.parse(from), Date.parse(to)] as const);
    return {
      camera, first: Math.min(...times.map(([from]) => from)), last: Math.max(...times.map(([, to]) => to)),
      secs: times.reduce((all, [from, to]) => all + (to - from) / 1e3, 0), gaps: Math.max(times.length - 1, 0),
    };
  });
}

async function learn() {
  const [system, counted, kept, exports] = await Promise.all([
    content(api.GET("/api/v1/system")), metrics(), spans(),
    content(api.GET("/api/v1/exports", { params: { query: { limit: 1000 } } })).then((told) => told.exports, () => []),
  ]);
  return { system, counted, kept, exports };
}

type Learnt = Awaited<ReturnType<typeof learn>>;

function Kept({ system, counted, exports }: Learnt) {
  const value = (name: string, labels?: Record<string, string>) => sum(counted ?? new Map(), `videofields_${name}`, labels);
  const uptime = system.uptime_secs ?? 0;
  const perDay = uptime > 60 ? (value("archive_bytes_total") / uptime) * DAY_SECS : null;
  const removed = say("system.removed.text", { bytes: value("archive_segments_removed_total", { reason: "bytes" }), age: value("archive_segments_removed_total", { reason: "age" }) });
  const paused = (counted?.get("videofields_archive_paused") ?? []).filter((sample) => sample.value > 0).map(({ labels }) => nameOf(labels["camera"] ?? ""));
  return (
    <>
      {paused.length > 0 && <p class="trouble">{say("system.paused", { cameras: paused.join(", ") })}</p>}
      <Facts facts={[
        ...(system.database ? [["system.database", bytes(system.database.bytes)] as const, ["system.schema", system.database.schema_version] as const] : []),
        ...(counted ? [
          ["system.archive", bytes(value("archive_kept_bytes"))] as const,
          ["system.perDay", perDay === null ? "–" : say("system.perDay.text", { bytes: bytes(perDay) })] as const,
          ["system.removed", removed] as const,
          ["system.snapshots", say("system.snapshots.text", { n: value("evidence_kept_snapshots"), bytes: bytes(value("evidence_kept_bytes")) })] as const,
          ["system.memory", bytes(value("timeline_kept_bytes"))] as const,
          ["system.checkpoint", say("system.checkpoint.text", { age: duration(value("store_checkpoint_age_seconds")), failed: value("store_checkpoints_failed_total") })] as const,
        ] : []),
        ["system.exports", say("system.exports.text", { n: exports.length, bytes: bytes(exports.reduce((all, one) => all + one.bytes, 0)) })],
      ]} />
      {!counted && <p class="quiet">{say("system.load.forbidden")}</p>}
    </>
  );
}

export default function Storage() {
  const learnt = useAsked(learn, SELDOM_MILLIS, String(state.scenes.value?.length ?? 0));
  return (
    <>
      <Part title="system.storage" learnt={learnt}>{(told) => <Kept {...told} />}</Part>
      <Part title="system.spans" learnt={learnt}>
        {({ kept }) => (
          <Table caption={say("system.spans")} none={say("system.spans.none")} columns={["column.camera", "column.recording", "column.oldest", "column.newest", "column.length", "column.gaps"]}
            rows={kept.map(({ camera, first, last, secs, gaps }) => {
              const recording = state.cameras.value?.find(({ id }) => id === camera)?.recording;
              const word = recording ? sayWord("recording", recording.state) : say("system.spans.memory");
              return [nameOf(camera), word, ...[first, last].map((at) => <span key={at} class="nowrap">{Number.isFinite(at) ? clock(at) : "–"}</span>), duration(secs), gaps];
            })} />
        )}
      </Part>
      <section class="card">
        <h2>{say("system.retention")}</h2>
        <p>{say("system.retention.help")}</p>
        <Table caption={say("system.retention")} none="" columns={["column.kept", "column.until", "column.setting"]}
          rows={(["recordings", "exports", "snapshots", "tracks", "activity", "backgrounds", "audit"] as const).map((what) => [
            say(`system.retention.${what}`), say(`system.retention.${what}.when`), <code key="setting">{say(`system.retention.${what}.setting`)}</code>,
          ])} />
      </section>
      <Jobs />
    </>
  );
}

function Jobs() {
  const learnt = useAsked(async () => (await content(api.GET("/api/v1/jobs", { params: { query: {} } }))).jobs, SELDOM_MILLIS);
  return (
    <Part title="system.jobs" learnt={learnt}>
      {(jobs) => (
        <Table caption={say("system.jobs")} none={say("system.jobs.none")} columns={["column.name", "column.state", "column.progress", "column.reason"]}
          rows={jobs.map(({ id, state: word, progress, reason }) => [id, word, progress == null ? "" : `${(progress * 100).toFixed(0)} %`, reason ?? ""])} />
      )}
    </Part>
  );
}
