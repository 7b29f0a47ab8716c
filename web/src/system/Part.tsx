// A titled part of System with what was learnt of it.

import type { ComponentChildren } from "preact";
import { type Learnt, Shown } from "../parts/parts";
import * as state from "../operate/state";
import { type Key, say } from "../strings";
import { clock } from "../units";

export const OFTEN_MILLIS = 3_000;
export const SELDOM_MILLIS = 10_000;

export const yes = (is: boolean) => say(is ? "answer.yes" : "answer.no");
export const when = (text: string) => clock(Date.parse(text));
export const nameOf = (id: string) => state.cameras.value?.find((camera) => camera.id === id)?.name ?? id;

export function Part<Data>({ title, learnt, children }: { title: Key; learnt: Learnt<Data>; children: (data: Data) => ComponentChildren }) {
  return (
    <section class="card">
      <h2>{say(title)}</h2>
      <Shown learnt={learnt}>{children}</Shown>
    </section>
  );
}
