// Whom the cameras see, and whom the viewer follows: who sees them now, the best picture, and which camera took them over.

import { Badge } from "../parts/parts";
import { say } from "../strings";
import { clock, duration } from "../units";
import { Crop } from "./Crop";
import { jumpInto } from "./jumping";
import { aboutPerson, toggleFollow } from "./Overlay";
import type { Person } from "./people";
import * as state from "./state";
import { followedPerson, people, peopleAt, peopleTrouble, successor } from "./tracking";

const timeOf = (millis: number) => clock(millis).slice(11);

function Lost({ person }: { person: Person }) {
  const next = successor.value;
  const away = (peopleAt.value - person.seenAt) / 1e3;
  return (
    <>
      <p class="lost" role="status">
        {say("follow.lost", { time: timeOf(person.seenAt), camera: person.best === null ? say("follow.nobody") : state.nameOf(person.best), age: duration(Math.max(0, away)) })}
      </p>
      <p class="row">
        <button type="button" onClick={() => state.setMark(person.position)}>{say("follow.where")}</button>
        {next && <button type="button" class="is-main" onClick={() => state.setFollowed(next.id)}>{say("follow.successor", { id: next.id })}</button>}
      </p>
    </>
  );
}

function SeenBy({ person }: { person: Person }) {
  return (
    <ul class="row" aria-label={say("follow.seen")}>
      {person.cameras.map((id) => (
        <li key={id}>
          <button type="button" class={id === person.best ? "is-on" : ""} data-sees={id} title={say("camera.open", { name: state.nameOf(id) })} onClick={() => void jumpInto(id)}>
            {state.nameOf(id)}
          </button>
        </li>
      ))}
    </ul>
  );
}

/** Whom the viewer follows. */
export function FollowPanel() {
  const id = state.followed.value;
  if (id === undefined) return null;
  const person = followedPerson.value;
  const camera = person?.best === null ? undefined : state.cameras.value?.find((known) => known.id === person?.best);
  return (
    <section class="panel follow" aria-label={say("follow.title", { id })} data-follow={id} data-lost={person?.isLost ?? true}>
      <header>
        <h2>{say("follow.title", { id })}</h2>
        <button type="button" onClick={() => state.setFollowed(null)} title={say("follow.end.title")}>{say("follow.end")}</button>
      </header>
      {!person && <p class="lost" role="status">{say("follow.unknown", { id })}</p>}
      {person?.isLost && <Lost person={person} />}
      {person && !person.isLost && <p class="quiet">{say("follow.seen")}</p>}
      {person && !person.isLost && <SeenBy person={person} />}
      {person && !person.isLost && camera && (
        <figure>
          <Crop person={person} camera={camera} />
          <figcaption class="quiet">{say("follow.best", { camera: camera.name })}</figcaption>
        </figure>
      )}
      {person && (
        <div aria-live="polite">
          <p class="quiet" data-ever={person.everSeenBy.join(" ")}>{say("follow.ever", { cameras: person.everSeenBy.map(state.nameOf).join(", ") })}</p>
          <ol class="hand-overs">
            {[...person.handOvers].reverse().map(({ at, from, to }) => (
              <li key={at}>{say("follow.handOver", { time: timeOf(at), from: state.nameOf(from), to: state.nameOf(to) })}</li>
            ))}
          </ol>
        </div>
      )}
    </section>
  );
}

/** Everybody, for the keyboard and for who is beside the picture. */
export function PeopleList() {
  const known = [...people.value.values()].sort((a, b) => Number(a.isLost) - Number(b.isLost) || a.id.localeCompare(b.id, undefined, { numeric: true }));
  return (
    <section aria-label={say("people.title")}>
      <div class="row">
        <label class="inline"><input type="checkbox" checked={state.labels.value === "on"}
          onChange={(event) => state.choose("labels", event.currentTarget.checked ? "on" : "off", "on")} /> {say("people.labels")}</label>
        <label class="inline"><input type="checkbox" checked={state.trails.value === "on"}
          onChange={(event) => state.choose("trails", event.currentTarget.checked ? "on" : "off", "on")} /> {say("people.trails")}</label>
      </div>
      {peopleTrouble.value !== null && <p class="reason" role="status">{peopleTrouble.value}</p>}
      {known.length === 0 && <p class="quiet">{say("people.none")}</p>}
      <ul class="list">
        {known.map((person) => (
          <li key={person.id} class={person.id === state.followed.value ? "is-chosen" : ""}>
            <span><b>{person.id}</b> <span class="quiet">{person.isLost ? say("people.lost", { time: timeOf(person.seenAt) }) : person.cameras.map(state.nameOf).join(", ")}</span></span>
            {person.isLost && <Badge state="stale" text={say("people.gone")} />}
            <button type="button" aria-pressed={person.id === state.followed.value} aria-label={`${say("people.follow")}: ${aboutPerson(person)}`} onClick={() => toggleFollow(person.id)}>
              {say(person.id === state.followed.value ? "follow.end" : "people.follow")}
            </button>
          </li>
        ))}
      </ul>
      <p class="quiet">{say("people.help")}</p>
    </section>
  );
}
