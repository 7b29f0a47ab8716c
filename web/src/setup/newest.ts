// Questions that follow a hand: each waits a moment, the newest ends those before it, and what came stays until something newer does.

import { useEffect, useRef, useState } from "preact/hooks";
import { Trouble } from "../ask";

const AFTER_BUSY_MILLIS = 700;
const MOST_TRIES = 6;

export type Newest<Answer> = {
  readonly value: Answer | null;
  readonly trouble: Trouble | null;
  readonly isAsking: boolean;
};

function pause(millis: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(resolve, millis);
    signal.addEventListener("abort", () => {
      clearTimeout(timer);
      reject(new DOMException("", "AbortError"));
    }, { once: true });
  });
}

/** Asks again where the daemon has too much to do just now; what lies at something of the question would not go away. */
async function patiently<Answer>(question: (signal: AbortSignal) => Promise<Answer>, signal: AbortSignal): Promise<Answer> {
  for (let tries = 1; ; tries += 1) {
    try {
      return await question(signal);
    } catch (error) {
      if (!(error instanceof Trouble) || error.status !== 503 || error.faults.length > 0 || tries === MOST_TRIES) throw error;
      await pause(AFTER_BUSY_MILLIS, signal);
    }
  }
}

/** Asks whenever `key` changes and rests for `restMillis`; nothing while it is null. */
export function useNewest<Answer>(key: string | null, restMillis: number, question: (signal: AbortSignal) => Promise<Answer>): Newest<Answer> {
  const [told, setTold] = useState<Newest<Answer>>({ value: null, trouble: null, isAsking: key !== null });
  const latest = useRef(question);
  latest.current = question;
  useEffect(() => {
    if (key === null) {
      setTold({ value: null, trouble: null, isAsking: false });
      return undefined;
    }
    const ending = new AbortController();
    setTold((before) => ({ ...before, isAsking: true }));
    const run = async () => {
      await pause(restMillis, ending.signal);
      const value = await patiently(latest.current, ending.signal);
      if (!ending.signal.aborted) setTold({ value, trouble: null, isAsking: false });
    };
    run().catch((error: unknown) => {
      if (ending.signal.aborted) return;
      const trouble = error instanceof Trouble ? error : new Trouble(String(error), 0);
      setTold({ value: null, trouble, isAsking: false });
    });
    return () => ending.abort();
  }, [key, restMillis]);
  return told;
}
