// A time that is typed. Enter goes there, or to what is nearest; what cannot be read is said beside it.

import { useEffect, useId, useRef, useState } from "preact/hooks";
import { told } from "../ask";
import { say } from "../strings";
import { clock } from "../units";
import * as clockwork from "./clockwork";
import { typed, zoneName } from "./moments";

export function TimeEntry({ isLive }: { isLive: boolean }) {
  const shown = clockwork.shownTime();
  const [text, setText] = useState<string | null>(null);
  const [fault, setFault] = useState<string | null>(null);
  const input = useRef<HTMLInputElement>(null);
  const faultId = useId();
  useEffect(() => setFault(null), [text]);
  const go = async () => {
    const read = typed(text ?? "", shown);
    if ("fault" in read) {
      setFault(say(`time.fault.${read.fault}`));
      return;
    }
    try {
      await clockwork.jump(read.millis);
      setText(null);
      input.current?.blur();
    } catch (error) {
      setFault(told(error));
    }
  };
  return (
    <form class="now" onSubmit={(event) => {
      event.preventDefault();
      void go();
    }}>
      <label>
        <span class="hidden">{say("time.entry")}</span>
        <input ref={input} type="text" class="moment" spellcheck={false} autocomplete="off" value={text ?? clock(shown, !isLive)}
          title={say("time.entry.title")} aria-invalid={fault !== null} aria-describedby={fault === null ? undefined : faultId}
          onFocus={(event) => {
            setText(clock(shown, !isLive));
            event.currentTarget.select();
          }}
          onBlur={() => {
            if (fault === null) setText(null);
          }}
          onInput={(event) => setText(event.currentTarget.value)}
          onKeyDown={(event) => {
            event.stopPropagation();
            if (event.key !== "Escape") return;
            setText(null);
            setFault(null);
            event.currentTarget.blur();
          }} />
      </label>
      <span class="quiet zone">{zoneName(shown)}</span>
      {text !== null && <button type="submit" onPointerDown={(event) => event.preventDefault()}>{say("time.go")}</button>}
      {fault !== null && <span id={faultId} class="reason" role="alert">{fault}</span>}
    </form>
  );
}
