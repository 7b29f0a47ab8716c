// A secret or a link that is shown once, to be copied.

import "./forms.css";
import { useId, useRef, useState } from "preact/hooks";
import { say } from "../strings";

/** Copies what a field holds; where the page may not write to the clipboard (without TLS) the text is selected to be copied by hand. */
async function copy(field: HTMLInputElement): Promise<boolean> {
  field.select();
  try {
    await navigator.clipboard.writeText(field.value);
    return true;
  } catch {
    return false;
  }
}

export function Copied({ label, text, note, onClose }: { label: string; text: string; note: string; onClose: () => void }) {
  const id = useId();
  const field = useRef<HTMLInputElement>(null);
  const [outcome, setOutcome] = useState("");
  return (
    <div class="copied">
      <label for={id}>{label}</label>
      <div class="copied-row">
        <input id={id} ref={field} type="text" readOnly value={text} spellcheck={false} aria-describedby={`${id}-note`} onFocus={(event) => event.currentTarget.select()} />
        <button type="button" onClick={() => {
          if (field.current) void copy(field.current).then((isCopied) => setOutcome(say(isCopied ? "copied.done" : "copied.byHand")));
        }}>{say("copied.copy")}</button>
        <button type="button" onClick={onClose}>{say("copied.close")}</button>
      </div>
      <p class="quiet" id={`${id}-note`}>{note}</p>
      <p class="quiet" role="status">{outcome}</p>
    </div>
  );
}
