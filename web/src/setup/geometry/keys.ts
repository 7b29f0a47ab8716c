// Keys over map and view.

import { isReadOnly } from "../draft";
import { duplicateChosen, moveChosen, removeChosen, standChosen, turnChosen } from "./actions";
import { enter, put, stepBack } from "./drawings";
import { cancelDrag } from "./pointing";
import { chosen, choose, drawing, hidden, preview, shown, tool } from "./state";
import { things } from "./things";

const STEP_M = { plain: 0.1, shift: 1 } as const;
const TURN_DEG = { plain: 15, shift: 1 } as const;
const WAYS: Readonly<Record<string, readonly [number, number, number]>> = {
  ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1],
};
const TOOL_KEYS = { v: "select", b: "box", c: "cylinder", w: "wall", f: "footprint" } as const;

/** Goes on to the next thing that is shown; false where there is none, so that Tab leads on. */
function chooseNext(by: 1 | -1): boolean {
  const all = things(shown.value).map(({ of }) => of.id).filter((id) => !hidden.value.has(id));
  const [first] = chosen.value;
  const next = first === undefined ? null : all[all.indexOf(first) + by];
  if (next === undefined || next === null) return false;
  choose([next]);
  return true;
}

function escape(): boolean {
  if (preview.value) cancelDrag();
  else if (tool.value !== "select") stepBack();
  else if (chosen.value.length > 0) choose([]);
  else return false;
  return true;
}

function onEnter(): boolean {
  if (tool.value !== "select") {
    enter();
    return true;
  }
  const first = things(shown.value).find(({ of }) => !hidden.value.has(of.id));
  if (chosen.value.length > 0 || !first) return false;
  choose([first.of.id]);
  return true;
}

/** What changes the chosen things; false where the key means nothing here. */
function edit({ key, shiftKey }: KeyboardEvent): boolean {
  if (chosen.value.length === 0 || isReadOnly.value) return false;
  const way = WAYS[key];
  const pace = shiftKey ? "shift" : "plain";
  if (way) moveChosen([way[0] * STEP_M[pace], way[1] * STEP_M[pace], way[2] * STEP_M[pace]]);
  else if (key === "Delete" || key === "Backspace") removeChosen();
  else if (key.toLowerCase() === "r") turnChosen(TURN_DEG[pace]);
  else if (key.toLowerCase() === "d") duplicateChosen();
  else if (key.toLowerCase() === "g") standChosen();
  else return false;
  return true;
}

function takeUp(key: string): boolean {
  const next = TOOL_KEYS[key.toLowerCase() as keyof typeof TOOL_KEYS] as (typeof TOOL_KEYS)[keyof typeof TOOL_KEYS] | undefined;
  if (!next || (isReadOnly.value && next !== "select")) return false;
  put(next);
  return true;
}

function handled(event: KeyboardEvent): boolean {
  const { key } = event;
  if (key === "Escape") return escape();
  if (key === "Enter") return onEnter();
  if (key === "Tab") return tool.value === "select" && chooseNext(event.shiftKey ? -1 : 1);
  if (key === "Backspace" && drawing.value) {
    stepBack();
    return true;
  }
  return edit(event) || takeUp(key);
}

/** Answers a key that is pressed while map or view have the focus. */
export function onKey(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey || !(event.target instanceof Element)) return;
  if (event.target.getAttribute("role") !== "application" || !handled(event)) return;
  event.preventDefault();
  event.stopPropagation();
}
