// What is drawn over the picture: people's ids at their feet, where they came from, and the marked place.

import { say } from "../strings";
import { type View, placed } from "./orbit";
import type { Person } from "./people";
import * as state from "./state";
import { people, peopleAt } from "./tracking";

type Spot = readonly [number, number];

const percent = ([x, y]: Spot) => ({ left: `${(x * 100).toFixed(2)}%`, top: `${(y * 100).toFixed(2)}%` });

/** What is said of somebody. */
export function aboutPerson(person: Person): string {
  if (person.isLost) return say("person.label.lost", { id: person.id });
  return say("person.label", { id: person.id, cameras: person.cameras.map(state.nameOf).join(", ") });
}

/** Follows them, or no longer. */
export function toggleFollow(id: string): void {
  state.setFollowed(state.followed.peek() === id ? null : id);
}

function Label({ person, at }: { person: Person; at: Spot }) {
  const isFollowed = state.followed.value === person.id;
  return (
    <button type="button" class={`person ${isFollowed ? "is-followed" : ""} ${person.isLost ? "is-lost" : ""}`} style={percent(at)}
      data-person={person.id} aria-label={aboutPerson(person)} aria-pressed={isFollowed} title={aboutPerson(person)}
      onClick={() => toggleFollow(person.id)}>
      {person.id}
    </button>
  );
}

/** A trail as the points of a line, a hundred of them across the picture. */
function line(view: View, aspect: number, person: Person): string {
  const points = person.trail.map(({ position }) => placed(view, aspect, position)).filter((spot) => spot !== null);
  return points.map(([x, y]) => `${(x * 100).toFixed(2)},${(y * 100).toFixed(2)}`).join(" ");
}

export function Overlay({ aspect }: { aspect: number }) {
  const view = state.shown.value?.view;
  if (!view) return null;
  const known = state.labels.value === "on" || state.followed.value !== undefined ? [...people.value.values()] : [];
  const shown = state.labels.value === "on" ? known : known.filter(({ id }) => id === state.followed.value);
  const mark = state.mark.value && placed(view, aspect, state.mark.value);
  return (
    <div class="overlay" role="group" aria-label={say("people.title")} data-people={shown.length} data-people-at={peopleAt.value}>
      {state.trails.value === "on" && (
        <svg class="trails" viewBox="0 0 100 100" preserveAspectRatio="none" aria-hidden="true">
          {shown.map((person) => (
            <polyline key={person.id} class={person.id === state.followed.value ? "is-followed" : ""} points={line(view, aspect, person)} />
          ))}
        </svg>
      )}
      {shown.map((person) => {
        const at = placed(view, aspect, person.position);
        return at && <Label key={person.id} person={person} at={at} />;
      })}
      {mark && <span class="spot" style={percent(mark)} />}
    </div>
  );
}
