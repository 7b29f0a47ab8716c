// A button whose deed cannot be taken back: it asks once more, in its place.

import "./forms.css";
import { useEffect, useRef, useState } from "preact/hooks";
import { say } from "../strings";

export function Sure({ text, question, label, onSure }: { text: string; question: string; label?: string; onSure: () => void }) {
  const [isAsking, setAsking] = useState(false);
  const no = useRef<HTMLButtonElement>(null);
  const first = useRef<HTMLButtonElement>(null);
  const hasAsked = useRef(false);
  useEffect(() => {
    if (isAsking) no.current?.focus();
    else if (hasAsked.current) first.current?.focus();
    hasAsked.current = isAsking;
  }, [isAsking]);
  if (!isAsking) return <button ref={first} type="button" aria-label={label} onClick={() => setAsking(true)}>{text}</button>;
  return (
    <span class="sure" role="group" aria-label={question}>
      <span>{question}</span>
      <button type="button" class="is-danger" onClick={() => {
        setAsking(false);
        onSure();
      }}>{text}</button>
      <button ref={no} type="button" onClick={() => setAsking(false)} onKeyDown={({ key }) => key === "Escape" && setAsking(false)}>{say("sure.no")}</button>
    </span>
  );
}
