// Fields of Set-up's forms: a label, what is typed, a hint, and what is wrong with it.

import type { ComponentChildren } from "preact";
import { useId, useState } from "preact/hooks";
import { settle } from "./draft";

type Around = { label: string; hint?: string | undefined; fault?: string | null | undefined };

function Field({ label, hint, fault, id, children }: Around & { id: string; children: ComponentChildren }) {
  return (
    <div class="field">
      <label for={id}>{label}</label>
      {children}
      {hint !== undefined && <span id={`${id}-hint`} class="quiet">{hint}</span>}
      <span id={`${id}-fault`} class="fault" role="status">{fault}</span>
    </div>
  );
}

/** A line of text. `onInput` at every key, `onSettle` when it is left or Enter is pressed. */
export function TextField({ value, onInput, onSettle, placeholder, maxLength, ...around }: Around & {
  value: string;
  onInput: (value: string) => void;
  onSettle?: (value: string) => void;
  placeholder?: string;
  maxLength?: number;
}) {
  const id = useId();
  return (
    <Field {...around} id={id}>
      <input id={id} type="text" value={value} {...(placeholder === undefined ? {} : { placeholder })} {...(maxLength === undefined ? {} : { maxLength })}
        spellcheck={false} autocomplete="off" aria-invalid={Boolean(around.fault)} aria-describedby={`${id}-hint ${id}-fault`}
        onInput={(event) => onInput(event.currentTarget.value)}
        onChange={(event) => {
          settle();
          onSettle?.(event.currentTarget.value);
        }} />
    </Field>
  );
}

/** Digits as people write them: no more than needed. */
export function digits(value: number, most = 3): string {
  return String(Number(value.toFixed(most)));
}

/** A number; nothing where it may be left out (`onChange(null)`) and is. What is no number, or out of range, is told and not taken. */
export function NumberField({ value, onChange, unit, min, max, places = 3, isOptional = false, ...around }: Around & {
  value: number | null;
  onChange: (value: number | null) => void;
  unit?: string;
  min?: number;
  max?: number;
  places?: number;
  isOptional?: boolean;
}) {
  const id = useId();
  // What is being typed may be no number yet.
  const [typed, setTyped] = useState<string | null>(null);
  const [isWrong, setWrong] = useState(false);
  const shown = typed ?? (value === null ? "" : digits(value, places));
  const take = (text: string) => {
    setTyped(text);
    const number = Number(text.replace(",", "."));
    const isEmpty = text.trim() === "";
    const isFit = isEmpty ? isOptional : Number.isFinite(number) && number >= (min ?? -Infinity) && number <= (max ?? Infinity);
    setWrong(!isFit);
    if (isFit) onChange(isEmpty ? null : number);
  };
  const leave = () => {
    setTyped(null);
    setWrong(false);
    settle();
  };
  const range = [min === undefined ? "" : `≥ ${min}`, max === undefined ? "" : `≤ ${max}`].filter(Boolean).join(", ");
  return (
    <Field {...around} id={id} fault={isWrong ? range || "0–9" : around.fault}>
      <span class="with-unit">
        <input id={id} type="text" inputMode="decimal" class="number" value={shown} autocomplete="off"
          aria-invalid={isWrong || Boolean(around.fault)} aria-describedby={`${id}-hint ${id}-fault`}
          onInput={(event) => take(event.currentTarget.value)} onBlur={leave} />
        {unit !== undefined && <span class="quiet">{unit}</span>}
      </span>
    </Field>
  );
}
