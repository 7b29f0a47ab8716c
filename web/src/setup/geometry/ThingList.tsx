// All that stands, by kind: to choose, show and hide. Names are changed in the panel.

import { say } from "../../strings";
import { atThing } from "../faults";
import { checks } from "./checks";
import { choose, chosen, hidden, isSkyChosen, setHidden, shown, toggle } from "./state";
import { LISTS, type List, ids, things } from "./things";

function Row({ id, isFaulty }: { id: string; isFaulty: boolean }) {
  const [isChosen, isHidden] = [chosen.value.includes(id), hidden.value.has(id)];
  return (
    <li class={isChosen ? "is-chosen" : undefined}>
      <button type="button" class="geo-name" aria-pressed={isChosen} onClick={(event) => (event.shiftKey || event.ctrlKey || event.metaKey ? toggle(id) : choose([id]))}>
        {id}{isFaulty && <span class="fault"> ! <span class="hidden">{say("geometry.list.faulty")}</span></span>}
      </button>
      <button type="button" class="geo-eye" aria-pressed={!isHidden} aria-label={say("geometry.list.shown", { id })} title={say("geometry.list.shown", { id })}
        onClick={() => setHidden([id], !isHidden)}>
        <svg viewBox="0 0 24 24" width="18" height="18" aria-hidden="true">
          <path d={isHidden ? "M3 12c5-7 13-7 18 0M4 20L20 4" : "M3 12c5-7 13-7 18 0-5 7-13 7-18 0zM12 9.5a2.5 2.5 0 100 5 2.5 2.5 0 000-5"} />
        </svg>
      </button>
    </li>
  );
}

function Group({ list, of, faulty }: { list: List; of: readonly string[]; faulty: ReadonlySet<string> }) {
  if (of.length === 0) return null;
  return (
    <li>
      <h3>{say(`geometry.list.${list}`, { count: of.length })}</h3>
      <ul>{of.map((id) => <Row key={id} id={id} isFaulty={faulty.has(id)} />)}</ul>
    </li>
  );
}

export function ThingList() {
  const all = things(shown.value);
  const faulty = new Set(checks(shown.value).map(({ id }) => id));
  for (const id of ids(shown.value)) if (atThing("geometry", { thing: id }) !== undefined) faulty.add(id);
  const named = ids(shown.value);
  return (
    <section class="card geo-list" aria-label={say("geometry.list")}>
      <div class="row">
        <h2>{say("geometry.list")}</h2>
        {hidden.value.size > 0 && <button type="button" class="push" onClick={() => setHidden([...hidden.value], false)}>{say("geometry.list.showAll")}</button>}
      </div>
      {named.length === 0 && <p class="quiet">{say("geometry.list.none")}</p>}
      <ul class="geo-groups">
        {LISTS.map((list) => <Group key={list} list={list} faulty={faulty} of={all.filter((one) => one.list === list).map(({ of }) => of.id)} />)}
        <li>
          <ul>
            <li class={isSkyChosen.value ? "is-chosen" : undefined}>
              <button type="button" class="geo-name" aria-pressed={isSkyChosen.value} onClick={() => choose(["sky"])}>{say("geometry.sky")}</button>
            </li>
          </ul>
        </li>
      </ul>
    </section>
  );
}
