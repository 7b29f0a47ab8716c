// Cameras: how each fares now, what it went through since the page was opened, and the daemon itself.

import { api, content } from "../ask";
import { Badge, Facts, type Learnt, Table, useAsked } from "../parts/parts";
import * as state from "../operate/state";
import { wayTo } from "../route";
import { say, sayWord } from "../strings";
import { bytes, clock, duration } from "../units";
import { Detection } from "./Detection";
import { changes } from "./health";
import { OFTEN_MILLIS, Part, SELDOM_MILLIS, nameOf, when } from "./Part";

const PICTURE_KINDS = ["frozen", "covered", "moved", "light_changed", "misaligned"];

function Summary({ cameras }: { cameras: readonly state.Camera[] }) {
  const troubled = cameras.filter((camera) => state.isTrouble(state.stateOf(camera)));
  return <p class="quiet">{troubled.length === 0 ? say("system.cameras.well", { n: cameras.length }) : say("system.cameras.troubled", { n: troubled.length, of: cameras.length })}</p>;
}

function Now() {
  const learnt: Learnt<state.Camera[]> = state.cameras.value ? { data: state.cameras.value } : {};
  return (
    <Part title="system.cameras" learnt={learnt}>
      {(cameras) => (
        <>
          <Summary cameras={cameras} />
          <Table caption={say("system.cameras")} none={say("cameras.none")}
            columns={["column.camera", "column.state", "column.since", "column.age", "column.size", "column.frames", "column.dropped", "column.retries", "column.recording", "column.privacy", "column.reason"]}
            rows={cameras.map((camera) => {
              const word = state.stateOf(camera);
              const { recording } = camera;
              return [
                <a key="name" href={wayTo("operate", { camera: camera.id })}>{camera.name}</a>,
                <Badge key="state" state={word} text={sayWord("state", word)} />,
                <span key="since" class="nowrap">{when(camera.since)}</span>,
                camera.age_secs === null ? "" : say("camera.age", { age: duration(camera.age_secs) }),
                camera.size_px?.join(" × ") ?? say("camera.noFrame"),
                camera.frames, camera.dropped, camera.retries,
                recording ? `${sayWord("recording", recording.state)}, ${bytes(recording.bytes)}` : say("recording.none"),
                camera.privacy.zones,
                [camera.reason, recording?.reason, camera.next_try ? say("system.cameras.next", { at: when(camera.next_try) }) : ""].filter(Boolean).join("; "),
              ];
            })} />
        </>
      )}
    </Part>
  );
}

function Past() {
  const events = useAsked(async () => {
    const all = await Promise.all((state.cameras.value ?? []).map(async ({ id }) =>
      (await content(api.GET("/api/v1/events", { params: { query: { camera: id, limit: 200 } } }))).events));
    return all.flat().filter(({ kind }) => PICTURE_KINDS.includes(kind));
  }, SELDOM_MILLIS, String(state.cameras.value?.length ?? 0));
  const rows = [
    ...changes.value.map(({ camera, from, to, at, reason }) => ({
      at, camera, text: from === null ? sayWord("state", to) : say("system.history.change", { from: sayWord("state", from), to: sayWord("state", to) }), reason: reason ?? "",
    })),
    ...(events.data ?? []).map(({ camera, kind, is_end, time }) => ({
      at: Date.parse(time), camera, text: is_end ? say("system.history.over", { what: sayWord("event", kind) }) : sayWord("event", kind), reason: "",
    })),
  ].sort((a, b) => b.at - a.at);
  return (
    <Part title="system.history" learnt={{ data: rows, ...(events.failure === undefined ? {} : { failure: events.failure }) }}>
      {(all) => (
        <>
          <p class="quiet">{say("system.history.help")}</p>
          <Table caption={say("system.history")} none={say("system.history.none")} columns={["column.time", "column.camera", "column.kind", "column.reason"]}
            rows={all.map(({ at, camera, text, reason }) => [<span key="at" class="nowrap">{clock(at)}</span>, nameOf(camera), text, reason])} />
        </>
      )}
    </Part>
  );
}

function Daemon() {
  const learnt = useAsked(() => content(api.GET("/api/v1/system")), OFTEN_MILLIS);
  return (
    <Part title="system.daemon" learnt={learnt}>
      {({ version, build, platform, device, uptime_secs, counts, limits }) => {
        const drawn = device === null ? say("system.device.none")
          : device.is_software ? say("system.device.software", { adapter: device.adapter }) : device.adapter;
        return (
          <Facts facts={[
            ["system.version", `${version} (${build})`],
            ["system.platform", `${platform.os}, ${platform.architecture}, ${platform.n_processors} CPU`],
            ["system.device", drawn],
            ["system.counts", say("system.counts.text", counts)],
            ["system.limits", limits.requests_at_once],
            ...(uptime_secs != null ? [["system.uptime", duration(uptime_secs)] as const] : []),
          ]} />
        );
      }}
    </Part>
  );
}

export default function Cameras() {
  return (
    <>
      <Now />
      <Past />
      <Detection />
      <Daemon />
    </>
  );
}
