// Small parts of pages that are used in several places.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { told } from "../ask";
import { type Key, say } from "../strings";

/** A choice of one of a few, side by side. */
export function Segments<Value extends string>(given: {
  name: string;
  label: string;
  values: readonly Value[];
  chosen: Value;
  text: (value: Value) => string;
  onChoose: (value: Value) => void;
}) {
  const { name, label, values, chosen, text, onChoose } = given;
  return (
    <fieldset class="segments">
      <legend>{label}</legend>
      {values.map((value) => (
        <label key={value}>
          <input type="radio" name={name} value={value} checked={value === chosen} onChange={() => onChoose(value)} />
          <span>{text(value)}</span>
        </label>
      ))}
    </fieldset>
  );
}

/** A table with a caption; nothing but `none` where it has no rows. */
export function Table({ caption, columns, rows, none }: {
  caption: string;
  columns: readonly Key[];
  rows: readonly (readonly ComponentChildren[])[];
  none: string;
}) {
  if (rows.length === 0) return <p class="quiet">{none}</p>;
  return (
    // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- what scrolls must be reachable by keys
    <div class="table" role="region" aria-label={caption} tabIndex={0}>
      <table>
        <thead>
          <tr>{columns.map((key) => <th key={key} scope="col">{say(key)}</th>)}</tr>
        </thead>
        <tbody>
          {rows.map((row, i) => <tr key={i}>{row.map((cell, j) => <td key={j}>{cell}</td>)}</tr>)}
        </tbody>
      </table>
    </div>
  );
}

/** A word of state in its colour. */
export function Badge({ state, text }: { state: string; text: string }) {
  return <span class="badge" data-state={state}>{text}</span>;
}

/** Names and values. */
export function Facts({ facts }: { facts: readonly (readonly [Key, ComponentChildren])[] }) {
  return (
    <dl class="facts">
      {facts.map(([key, value]) => <div key={key}><dt>{say(key)}</dt><dd>{value}</dd></div>)}
    </dl>
  );
}

export type Learnt<Data> = { data?: Data; failure?: string };

/** Asks again and again while it is shown: what came last, and what went wrong since. */
export function useAsked<Data>(question: () => Promise<Data>, everyMillis: number, key = ""): Learnt<Data> {
  const [learnt, setLearnt] = useState<Learnt<Data>>({});
  const latest = useRef(question);
  latest.current = question;
  useEffect(() => {
    let isShown = true;
    let timer: ReturnType<typeof setTimeout> | undefined;
    const round = async () => {
      try {
        const data = document.hidden ? undefined : await latest.current();
        if (isShown && data !== undefined) setLearnt({ data });
      } catch (error) {
        if (isShown) setLearnt((before) => ({ ...before, failure: told(error) }));
      }
      if (isShown) timer = setTimeout(() => void round(), everyMillis);
    };
    void round();
    return () => {
      isShown = false;
      clearTimeout(timer);
    };
  }, [everyMillis, key]);
  return learnt;
}

/** What was learnt, what went wrong, or that it is being asked for. */
export function Shown<Data>({ learnt, children }: { learnt: Learnt<Data>; children: (data: Data) => ComponentChildren }) {
  return (
    <>
      {learnt.failure !== undefined && <p class="trouble">{say("system.failed", { message: learnt.failure })}</p>}
      {learnt.data !== undefined ? children(learnt.data) : learnt.failure === undefined && <p class="quiet">{say("place.loading")} …</p>}
    </>
  );
}
