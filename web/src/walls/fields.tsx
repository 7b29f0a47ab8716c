// Fields of a form about a document: what is wrong with one is told beneath it and read out with it.

import type { ComponentChildren } from "preact";
import { useEffect, useId, useState } from "preact/hooks";
import { say } from "../strings";
import type { Faults } from "./validity";

type Placed = { readonly label: string; readonly pointer: string; readonly faults: Faults };

/** The fault at a place; of a list also one that was told of the whole of it. */
function faultAt(faults: Faults, pointer: string): string | undefined {
  return faults.get(pointer) ?? (/\/0$/.test(pointer) ? faults.get(pointer.replace(/\/0$/, "")) : undefined);
}

function Field({ label, id, fault, children }: { label: string; id: string; fault: string | undefined; children: ComponentChildren }) {
  return (
    <div class="entry">
      <label for={id}>{label}</label>
      {children}
      {fault !== undefined && <p class="wrong" id={`${id}-fault`}>{fault}</p>}
    </div>
  );
}

/** A number, kept whenever what is typed is one. */
export function NumberField(given: Placed & {
  value: number;
  onChange: (value: number) => void;
  step?: number | "any";
  isWhole?: boolean;
  unit?: string;
}) {
  const { label, pointer, faults, value, onChange, step = "any", isWhole = false, unit } = given;
  const id = useId();
  const [text, setText] = useState<string | null>(null);
  // What is changed elsewhere (undo, a drag) shows at once; what is being typed stays as it is typed.
  useEffect(() => setText((typed) => (typed !== null && Number(typed) === value && typed !== "" ? typed : null)), [value]);
  const isNumber = text === null || (text.trim() !== "" && Number.isFinite(Number(text)) && (!isWhole || Number.isInteger(Number(text))));
  const fault = isNumber ? faultAt(faults, pointer) : say(isWhole ? "wall.fault.whole" : "wall.fault.number");
  return (
    <Field label={unit ? `${label}, ${unit}` : label} id={id} fault={fault}>
      <input id={id} type="number" step={step} value={text ?? String(value)} aria-invalid={fault !== undefined}
        aria-describedby={fault === undefined ? undefined : `${id}-fault`}
        onInput={(event) => {
          const typed = event.currentTarget.value;
          setText(typed);
          const read = Number(typed);
          if (typed.trim() !== "" && Number.isFinite(read) && (!isWhole || Number.isInteger(read))) onChange(read);
        }}
        onBlur={() => isNumber && setText(null)} />
    </Field>
  );
}

export function TextField(given: Placed & { value: string; onChange: (value: string) => void; help?: string; isFixed?: boolean }) {
  const { label, pointer, faults, value, onChange, help, isFixed = false } = given;
  const id = useId();
  const fault = faultAt(faults, pointer);
  const described = [fault === undefined ? "" : `${id}-fault`, help ? `${id}-help` : ""].filter(Boolean).join(" ");
  return (
    <Field label={label} id={id} fault={fault}>
      <input id={id} type="text" value={value} readOnly={isFixed} autocomplete="off" spellcheck={false} aria-invalid={fault !== undefined}
        aria-describedby={described || undefined} onInput={(event) => onChange(event.currentTarget.value)} />
      {help && <p class="quiet" id={`${id}-help`}>{help}</p>}
    </Field>
  );
}

export function SelectField(given: Placed & { value: string; options: readonly (readonly [string, string])[]; onChange: (value: string) => void }) {
  const { label, pointer, faults, value, options, onChange } = given;
  const id = useId();
  const fault = faultAt(faults, pointer);
  return (
    <Field label={label} id={id} fault={fault}>
      <select id={id} value={value} aria-invalid={fault !== undefined} aria-describedby={fault === undefined ? undefined : `${id}-fault`}
        onChange={(event) => onChange(event.currentTarget.value)}>
        {options.map(([key, text]) => <option key={key} value={key}>{text}</option>)}
      </select>
    </Field>
  );
}

/** Numbers that belong together, such as a point. */
export function NumbersField<Values extends readonly number[]>(given: Placed & {
  values: Values;
  names: readonly string[];
  onChange: (values: Values) => void;
  step?: number;
  isWhole?: boolean;
  unit?: string;
}) {
  const { label, pointer, faults, values, names, onChange, unit, ...rest } = given;
  return (
    <fieldset class="numbers">
      <legend>{unit ? `${label}, ${unit}` : label}</legend>
      {names.map((name, i) => (
        <NumberField key={name} label={name} pointer={`${pointer}/${i}`} faults={faults} value={values[i] ?? 0} {...rest}
          onChange={(value) => onChange(values.map((old, at) => (at === i ? value : old)) as unknown as Values)} />
      ))}
    </fieldset>
  );
}
