// Keys that hold wherever the focus is on Operate, unless somebody types.

import * as clockwork from "./clockwork";
import { jumpOut } from "./jumping";
import { nearest } from "./people";
import { groundAt } from "./scenery";
import * as state from "./state";
import { people } from "./tracking";
import { goToNumber } from "./Views";
import { type Mode, taken } from "./ways";

/** Moves the viewer another way from now on. */
export function chooseMode(mode: Mode): void {
  const view = state.view.peek();
  if (view && mode !== state.mode.peek()) state.setView(taken(view, mode, (x, y) => groundAt(x, y, view.eye[2])));
  state.choose("move", mode, "orbit");
}

/** Follows whom the focus is on, else whoever is nearest to the middle of the view; or nobody any more. */
function follow(target: Element | null): void {
  const named = target?.closest<HTMLElement>("[data-person]")?.dataset["person"];
  if (named !== undefined) {
    state.setFollowed(state.followed.peek() === named ? null : named);
    return;
  }
  if (state.followed.peek() !== undefined) {
    state.setFollowed(null);
    return;
  }
  const view = state.view.peek() ?? state.shown.peek()?.view;
  const person = view && nearest(people.peek().values(), view.target, Infinity);
  if (person) state.setFollowed(person.id);
}

/** Ends what was begun last: a camera's own picture, following, the marked place, the large map. */
function leave(): boolean {
  if (state.openedCamera.peek() !== undefined) jumpOut();
  else if (state.followed.peek() !== undefined) state.setFollowed(null);
  else if (state.mark.peek() !== null) state.setMark(null);
  else if (state.map.peek() === "large") state.choose("map", "inset", "inset");
  else return false;
  return true;
}

const KEYS: Record<string, (target: Element | null) => void> = {
  f: follow,
  m: () => state.choose("map", state.map.peek() === "large" ? "inset" : "large", "inset"),
  o: () => chooseMode("orbit"),
  g: () => chooseMode("walk"),
  v: () => chooseMode("fly"),
  l: clockwork.goLive,
  ",": () => void clockwork.step(-1),
  ".": () => void clockwork.step(1),
  j: () => clockwork.togglePlay(-1),
  k: () => clockwork.pause(),
  p: () => (clockwork.playing.peek() === null ? clockwork.togglePlay(1) : clockwork.pause()),
};

function isTyping(target: Element | null): boolean {
  return target?.closest("input:not([type=checkbox], [type=radio]), textarea, select, dialog") != null;
}

/** Listens until the answered function is called. */
export function attend(): () => void {
  const listen = (event: KeyboardEvent) => {
    const target = event.target instanceof Element ? event.target : null;
    if (event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented || isTyping(target)) return;
    if (event.key === "Escape" ? leave() : /^[1-9]$/.test(event.key) ? goToNumber(Number(event.key)) : run(event.key, target)) event.preventDefault();
  };
  addEventListener("keydown", listen);
  return () => removeEventListener("keydown", listen);
}

function run(key: string, target: Element | null): boolean {
  const then = KEYS[key];
  then?.(target);
  return then !== undefined;
}
