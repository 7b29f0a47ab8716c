// Views that people keep for each other: going there, by a click or a number; keeping the present one; renaming and removing.

import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { api, change, content, told } from "../ask";
import { nameEnding } from "../session";
import { say } from "../strings";
import { goTo } from "./flying";
import { printed, read } from "./orbit";
import { isOperator } from "./rights";
import * as state from "./state";
import { idFor } from "./viewids";

type Listed = Awaited<ReturnType<typeof asked>>["views"][number];

const AGAIN_MILLIS = 10_000;
const NUMBERS = 9;
/** What of a view, beside its place, is kept. */
const CHOICES = { entities: "billboards", see_through: "on", colors: "even", fields: "off", quality: "balanced", occlusion: "scene", relight: "scene", stipple: "scene" } as const;

const views = signal<Listed[]>([]);
const failure = signal<string | null>(null);

const asked = (scene: string) => content(api.GET("/api/v1/views", { params: { query: { scene } } }));

async function learn(): Promise<void> {
  const scene = state.scene.peek()?.id;
  if (scene === undefined || document.hidden) return;
  try {
    views.value = (await asked(scene)).views;
  } catch (error) {
    failure.value = told(error);
  }
}

/** Does it, learns of what there is then, and tells what went wrong. */
async function doing(what: () => Promise<unknown>): Promise<boolean> {
  try {
    await what();
    failure.value = null;
    return true;
  } catch (error) {
    failure.value = told(error);
    return false;
  } finally {
    await learn();
  }
}

/** Looks from there, as whoever kept it looked. */
export function goToView({ parameters }: Listed): void {
  const parts = Object.fromEntries(new URLSearchParams(parameters));
  for (const [name, usual] of Object.entries(CHOICES)) state.choose(name, parts[name] ?? usual, usual);
  const view = read(parts);
  if (view) void goTo(view);
  else state.resetView();
}

/** Goes to one of the first nine by its number. */
export function goToNumber(number: number): boolean {
  const view = views.peek()[number - 1];
  if (view) goToView(view);
  return view !== undefined;
}

function present(): string {
  const view = state.view.peek() ?? state.shown.peek()?.view;
  const chosen = { entities: state.entities.peek(), see_through: state.seeThrough.peek(), colors: state.colors.peek(), quality: state.quality.peek(), ...state.effects.peek() };
  const unusual = Object.entries(chosen).filter(([name, value]) => value !== CHOICES[name as keyof typeof CHOICES]);
  return new URLSearchParams({ ...(view ? printed(view) : {}), ...Object.fromEntries(unusual) }).toString().replaceAll("%2C", ",");
}

/** Learns of views as long as Operate is open, so that number keys work. */
export function attend(): () => void {
  const stop = state.scene.subscribe(() => void learn());
  const timer = setInterval(() => void learn(), AGAIN_MILLIS);
  return () => {
    stop();
    clearInterval(timer);
  };
}

function Keep() {
  const [name, setName] = useState("");
  const [group, setGroup] = useState("");
  const keep = async () => {
    const scene = state.scene.value?.id;
    if (scene === undefined || name.trim() === "") return;
    // Ids of views of other scenes are taken too.
    const all = await content(api.GET("/api/v1/views", {})).then(({ views }) => views, () => views.peek());
    const id = idFor(name, new Set(all.map((view) => view.id)), nameEnding());
    const order = views.peek().filter((view) => view.group === group.trim()).length;
    const body = { name: name.trim(), scene, group: group.trim(), order, parameters: present() };
    if (await doing(() => change("PUT", `/api/v1/views/${id}`, body, { tag: null }))) setName("");
  };
  return (
    <form class="keep-view" onSubmit={(event) => {
      event.preventDefault();
      void keep();
    }}>
      <label>{say("views.name")}<input required maxLength={200} value={name} onInput={(event) => setName(event.currentTarget.value)} /></label>
      <label>{say("views.group")}<input maxLength={100} list="view-groups" value={group} onInput={(event) => setGroup(event.currentTarget.value)} /></label>
      <datalist id="view-groups">{[...new Set(views.value.map((view) => view.group))].filter(Boolean).map((known) => <option key={known} value={known} />)}</datalist>
      <button type="submit" class="is-main">{say("views.keep")}</button>
    </form>
  );
}

function Row({ view, number }: { view: Listed; number: number }) {
  const [doingWhat, setDoing] = useState<"rename" | "remove" | null>(null);
  const [name, setName] = useState(view.name);
  useEffect(() => setName(view.name), [view.name]);
  const path = `/api/v1/views/${encodeURIComponent(view.id)}`;
  const tag = `"${view.version}"`;
  const title = view.name || view.id;
  return (
    <li data-view-id={view.id}>
      {doingWhat === "rename" ? (
        <form class="row" onSubmit={(event) => {
          event.preventDefault();
          void doing(() => change("PATCH", path, { name: name.trim() }, { tag })).then(() => setDoing(null));
        }}>
          <input aria-label={say("views.name")} required maxLength={200} value={name} onInput={(event) => setName(event.currentTarget.value)} />
          <button type="submit" class="is-main">{say("views.rename.do")}</button>
          <button type="button" onClick={() => setDoing(null)}>{say("answer.cancel")}</button>
        </form>
      ) : (
        <>
          <button type="button" class="go" onClick={() => goToView(view)}>
            {number <= NUMBERS && <kbd>{number}</kbd>} {title}
          </button>
          {isOperator() && doingWhat === null && (
            <span class="pair">
              <button type="button" aria-label={say("views.rename", { name: title })} title={say("views.rename", { name: title })} onClick={() => setDoing("rename")}>✎</button>
              <button type="button" aria-label={say("views.remove", { name: title })} title={say("views.remove", { name: title })} onClick={() => setDoing("remove")}>×</button>
            </span>
          )}
          {doingWhat === "remove" && (
            <span class="pair">
              <button type="button" class="is-bad" onClick={() => void doing(() => change("DELETE", path, undefined, { tag })).then(() => setDoing(null))}>{say("views.remove.do")}</button>
              <button type="button" onClick={() => setDoing(null)}>{say("answer.cancel")}</button>
            </span>
          )}
        </>
      )}
    </li>
  );
}

export function Views() {
  const known = views.value;
  const groups = [...new Set(known.map(({ group }) => group))];
  return (
    <section aria-label={say("side.views")}>
      {failure.value !== null && <p class="reason" role="alert">{failure.value}</p>}
      {known.length === 0 && <p class="quiet">{say("views.none")}</p>}
      {groups.map((group) => (
        <div key={group}>
          {group !== "" && <h3>{group}</h3>}
          <ul class="list">
            {known.map((view, i) => view.group === group && <Row key={view.id} view={view} number={i + 1} />)}
          </ul>
        </div>
      ))}
      {isOperator() ? <Keep /> : <p class="quiet">{say("views.operators")}</p>}
    </section>
  );
}
