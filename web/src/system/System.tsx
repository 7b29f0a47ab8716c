// System: how the daemon and its cameras fare, what is stored, what happened, who may do what. To read.

import type { ComponentChildren } from "preact";
import { api, content } from "../ask";
import { Badge, Facts, type Learnt, Shown, Table, useAsked } from "../parts/parts";
import * as state from "../operate/state";
import { printed } from "../operate/orbit";
import { wayTo } from "../route";
import { session } from "../session";
import { type Key, say, sayWord } from "../strings";
import { bytes, clock, duration } from "../units";

const OFTEN_MILLIS = 3_000;
const SELDOM_MILLIS = 10_000;
const DAY_MILLIS = 86_400e3;
const SHOWN_EVENTS = 100;

const yes = (is: boolean) => say(is ? "answer.yes" : "answer.no");
const when = (text: string) => clock(Date.parse(text));
const nameOf = (id: string) => state.cameras.value?.find((camera) => camera.id === id)?.name ?? id;

function Part<Data>({ title, learnt, children }: { title: Key; learnt: Learnt<Data>; children: (data: Data) => ComponentChildren }) {
  return (
    <section class="card">
      <h2>{say(title)}</h2>
      <Shown learnt={learnt}>{children}</Shown>
    </section>
  );
}

function Daemon() {
  const learnt = useAsked(() => content(api.GET("/api/v1/system")), OFTEN_MILLIS);
  const recorded = (state.cameras.value ?? []).reduce((sum, { recording }) => sum + (recording?.bytes ?? 0), 0);
  return (
    <>
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
      <Part title="system.storage" learnt={learnt}>
        {({ database }) => (
          <Facts facts={[
            ...(database ? [["system.database", bytes(database.bytes)] as const, ["system.schema", database.schema_version] as const] : []),
            ["system.recorded", bytes(recorded)],
          ]} />
        )}
      </Part>
    </>
  );
}

function Cameras() {
  const learnt: Learnt<state.Camera[]> = state.cameras.value ? { data: state.cameras.value } : {};
  return (
    <Part title="system.cameras" learnt={learnt}>
      {(cameras) => (
        <Table caption={say("system.cameras")} none={say("cameras.none")}
          columns={["column.camera", "column.state", "column.age", "column.size", "column.frames", "column.dropped", "column.retries", "column.recording", "column.reason"]}
          rows={cameras.map((camera) => {
            const word = state.stateOf(camera);
            const { recording } = camera;
            return [
              <a key="name" href={wayTo("operate", { camera: camera.id })}>{camera.name}</a>,
              <Badge key="state" state={word} text={sayWord("state", word)} />,
              camera.age_secs === null ? "" : say("camera.age", { age: duration(camera.age_secs) }),
              camera.size_px?.join(" × ") ?? say("camera.noFrame"),
              camera.frames, camera.dropped, camera.retries,
              recording ? `${sayWord("recording", recording.state)}, ${bytes(recording.bytes)}` : say("recording.none"),
              [camera.reason, recording?.reason].filter(Boolean).join("; "),
            ];
          })} />
      )}
    </Part>
  );
}

function Events() {
  const learnt = useAsked(async () => {
    // An event's id is the microsecond in which it was told.
    const after = Math.round((Date.now() - DAY_MILLIS) * 1e3);
    return (await content(api.GET("/api/v1/events", { params: { query: { after, limit: 1000 } } }))).events.reverse().slice(0, SHOWN_EVENTS);
  }, OFTEN_MILLIS);
  return (
    <Part title="system.events" learnt={learnt}>
      {(events) => (
        <Table caption={say("system.events")} none={say("system.events.none")}
          columns={["column.time", "column.camera", "column.kind", "column.over"]}
          rows={events.map(({ time, camera, kind, is_end }) => [
            <a key="time" href={wayTo("operate", { at: time })}>{when(time)}</a>, nameOf(camera), sayWord("event", kind), yes(is_end),
          ])} />
      )}
    </Part>
  );
}

function Jobs() {
  const learnt = useAsked(async () => (await content(api.GET("/api/v1/jobs"))).jobs, OFTEN_MILLIS);
  return (
    <Part title="system.jobs" learnt={learnt}>
      {(jobs) => (
        <Table caption={say("system.jobs")} none={say("system.jobs.none")} columns={["column.name", "column.state", "column.progress"]}
          rows={jobs.map(({ id, state: word, progress }) => [id, word, progress == null ? "" : `${(progress * 100).toFixed(0)} %`])} />
      )}
    </Part>
  );
}

function People() {
  const users = useAsked(async () => (await content(api.GET("/api/v1/users"))).users, SELDOM_MILLIS);
  const tokens = useAsked(async () => (await content(api.GET("/api/v1/tokens"))).tokens, SELDOM_MILLIS);
  return (
    <>
      <Part title="system.users" learnt={users}>
        {(told) => (
          <Table caption={say("system.users")} none={say("system.users.none")}
            columns={["column.user", "column.role", "column.rights", "column.password"]}
            rows={told.map(({ id, role, cameras, has_password }) => [
              id, role, Object.entries(cameras).map(([camera, rights]) => `${camera}: ${rights.join(", ")}`).join("; "), yes(has_password),
            ])} />
        )}
      </Part>
      <Part title="system.tokens" learnt={tokens}>
        {(told) => (
          <Table caption={say("system.tokens")} none={say("system.tokens.none")}
            columns={["column.user", "column.note", "column.made", "column.expires"]}
            rows={told.map(({ user, note, created_at, expires_at }) => [
              user, note, when(created_at), expires_at === null ? say("answer.forever") : when(expires_at),
            ])} />
        )}
      </Part>
    </>
  );
}

function Plan() {
  const scene = state.scene.value;
  const learnt = useAsked(async () => {
    if (!scene) return undefined;
    const query = {
      entities: state.entities.value, quality: state.quality.value, see_through: state.seeThrough.value, colors: state.colors.value,
      ...(state.view.value ? { ...printed(state.view.value), fov: state.view.value.fov } : {}),
    };
    return content(api.GET("/api/v1/scenes/{id}/plan", { params: { path: { id: scene.id }, query } }));
  }, OFTEN_MILLIS, scene?.id);
  if (!scene) return null;
  return (
    <Part title="system.plan" learnt={learnt}>
      {(plan) => plan && (
        <>
          {plan.expected_ms !== null && plan.expected_upper_ms !== null && (
            <p class="quiet">
              {say("system.plan.expected", { ms: plan.expected_ms.toFixed(0), upper: plan.expected_upper_ms.toFixed(0), by: plan.expected_by ?? "" })}
            </p>
          )}
          <Table caption={say("system.plan")} none="" columns={["column.effect", "column.on", "column.reason"]}
            rows={plan.effects.map(({ effect, is_on, because }) => [effect.replaceAll("_", " "), yes(is_on), because])} />
        </>
      )}
    </Part>
  );
}

export default function System() {
  return (
    <div class="column">
      <h1>{say("system.title")}</h1>
      <Cameras />
      <Events />
      <Daemon />
      <Jobs />
      <Plan />
      {session.value?.role === "admin" && <People />}
    </div>
  );
}
