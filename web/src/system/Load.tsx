// Load: what the daemon has to do and how long it takes, since this page was opened.

import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { Trouble, ask, told } from "../ask";
import { Table } from "../parts/parts";
import { type Key, say, sayWord } from "../strings";
import { bytes } from "../units";
import { nameOf } from "./Part";
import { type Metrics, type Of, type Reading, mean, parse, rate, sum } from "./prometheus";
import { Sparkline } from "./Sparkline";

const EVERY_MILLIS = 2_000;
/** Readings that are kept: a quarter of an hour. */
const MOST_READINGS = 450;

const readings = signal<readonly Reading[]>([]);

const of = (name: string, labels?: Record<string, string>): Of => (metrics) => sum(metrics, `videofields_${name}`, labels);
const failed: Of = (metrics) => (metrics.get("videofields_api_requests_total") ?? []).filter(({ labels }) => (labels["status"] ?? "").startsWith("5")).reduce((all, { value }) => all + value, 0);

type Line = { name: Key; text: (value: number) => string; value: (before: Reading, now: Reading) => number | null };

const perSecond = (value: number) => say("system.load.perSecond", { n: value.toFixed(1) });
const millis = (value: number) => say("system.load.millis", { n: value < 10 ? value.toFixed(1) : value.toFixed(0) });
const gauge = (read: Of) => (_: Reading, now: Reading) => read(now.metrics);
const counter = (read: Of) => (before: Reading, now: Reading) => rate(read, before, now);
const average = (name: string) => (before: Reading, now: Reading) => mean(of(`${name}_sum`), of(`${name}_count`), before, now);

const LINES: readonly Line[] = [
  { name: "system.load.requests", text: perSecond, value: counter(of("api_requests_total")) },
  { name: "system.load.failed", text: perSecond, value: counter(failed) },
  { name: "system.load.pictures", text: perSecond, value: counter(of("render_picture_seconds_count")) },
  { name: "system.load.picture", text: millis, value: average("render_picture_seconds") },
  { name: "system.load.wait", text: millis, value: average("render_wait_seconds") },
  { name: "system.load.queue", text: (value) => value.toFixed(0), value: gauge(of("render_queue_length")) },
  { name: "system.load.refused", text: perSecond, value: counter(of("render_refused_total")) },
  { name: "system.load.cached", text: perSecond, value: counter((metrics) => of("render_cache_hits_total")(metrics) + of("render_shared_total")(metrics)) },
  { name: "system.load.memory", text: bytes, value: gauge((metrics) => of("timeline_kept_bytes")(metrics) + of("render_cache_bytes")(metrics)) },
  { name: "system.load.written", text: (value) => say("system.load.bytesPerSecond", { n: bytes(value) }), value: counter(of("archive_bytes_total")) },
  { name: "system.load.sync", text: millis, value: average("archive_sync_seconds") },
  { name: "system.load.checkpoint", text: millis, value: average("store_checkpoint_seconds") },
];

async function look(): Promise<void> {
  const response = await ask("/metrics");
  const reading = { at: performance.now(), metrics: parse(await response.text()) };
  readings.value = [...readings.value, reading].slice(-MOST_READINGS);
}

function stagesOf(camera: string, before: Reading, now: Reading): number | null {
  const labels = { camera };
  // A frame goes through all stages: their sum over the frames of one.
  const count: Of = of("ingest_stage_seconds_count", { camera, stage: "background" });
  return mean(of("ingest_stage_seconds_sum", labels), count, before, now);
}

/** Why frames were left out, with how many of each. */
function reasons(metrics: Metrics, camera: string): string {
  return (metrics.get("videofields_ingest_frames_dropped_total") ?? [])
    .filter(({ labels, value }) => labels["camera"] === camera && value > 0)
    .map(({ labels, value }) => say("system.load.reason", { reason: sayWord("drop", labels["reason"] ?? ""), n: value })).join(", ");
}

function OfCameras({ before, now }: { before: Reading; now: Reading }) {
  const ids = (now.metrics.get("videofields_ingest_frames_total") ?? []).map(({ labels }) => labels["camera"] ?? "");
  const shown = (value: number | null, text: (value: number) => string) => (value === null ? "–" : text(value));
  return (
    <section class="card">
      <h2>{say("system.load.cameras")}</h2>
      <Table caption={say("system.load.cameras")} none={say("cameras.none")}
        columns={["column.camera", "column.rate", "column.vision", "column.droppedRate", "column.dropped", "column.memory"]}
        rows={ids.map((camera) => [
          nameOf(camera),
          shown(rate(of("ingest_frames_total", { camera }), before, now), perSecond),
          shown(stagesOf(camera, before, now), millis),
          shown(rate(of("ingest_frames_dropped_total", { camera }), before, now), perSecond),
          reasons(now.metrics, camera) || "0",
          bytes(of("timeline_kept_bytes", { camera })(now.metrics)),
        ])} />
    </section>
  );
}

export default function Load() {
  const [trouble, setTrouble] = useState<string | null>(null);
  useEffect(() => {
    let isShown = true;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const round = async () => {
      try {
        if (!document.hidden) await look();
        if (isShown) setTrouble(null);
      } catch (error) {
        if (isShown) setTrouble(error instanceof Trouble && error.status === 403 ? say("system.load.forbidden") : told(error));
      }
      if (isShown) timer = setTimeout(() => void round(), EVERY_MILLIS);
    };
    void round();
    return () => {
      isShown = false;
      clearTimeout(timer);
    };
  }, []);
  const all = readings.value;
  const pairs = all.slice(1).map((now, i) => [all[i] ?? now, now] as const);
  const [before, now] = [all.at(-6) ?? all[0], all.at(-1)];
  return (
    <>
      {trouble !== null && <p class="trouble">{trouble}</p>}
      {trouble === null && pairs.length === 0 && <p class="quiet">{say("place.loading")} …</p>}
      {pairs.length > 0 && (
        <section class="card">
          <h2>{say("system.load")}</h2>
          <p class="quiet">{say("system.load.help")}</p>
          <ul class="sparks">
            {LINES.map(({ name, text, value }) => {
              const values = pairs.map(([a, b]) => value(a, b));
              const last = values.findLast((one) => one !== null);
              return (
                <li key={name}>
                  <span class="quiet">{say(name)}</span>
                  <strong>{last == null ? "–" : text(last)}</strong>
                  <Sparkline name={say(name)} values={values} text={text} />
                </li>
              );
            })}
          </ul>
        </section>
      )}
      {before && now && before !== now && <OfCameras before={before} now={now} />}
    </>
  );
}
