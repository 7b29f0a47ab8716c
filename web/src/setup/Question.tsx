// A question before something is lost, asked in a dialog that keeps the focus until it is answered.

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { say } from "../strings";

type Question = { readonly text: string; readonly yes: string; readonly answer: (isYes: boolean) => void };

const question = signal<Question | null>(null);

/** Resolves to whether it was answered with `yes`, the name of what is to be done. */
export function confirmed(text: string, yes: string): Promise<boolean> {
  return new Promise((resolve) => {
    question.value = {
      text, yes,
      answer: (isYes) => {
        question.value = null;
        resolve(isYes);
      },
    };
  });
}

/** Where questions are asked; stands once in Set-up. */
export function Questions() {
  const dialog = useRef<HTMLDialogElement>(null);
  const asked = question.value;
  useEffect(() => {
    if (asked) dialog.current?.showModal();
    else dialog.current?.close();
  }, [asked]);
  return (
    <dialog ref={dialog} class="question" aria-labelledby="question-text" onCancel={(event) => {
      event.preventDefault();
      asked?.answer(false);
    }}>
      <p id="question-text">{asked?.text}</p>
      <p class="row end">
        <button type="button" onClick={() => asked?.answer(false)}>{say("setup.question.no")}</button>
        <button type="button" class="is-main" onClick={() => asked?.answer(true)}>{asked?.yes}</button>
      </p>
    </dialog>
  );
}
