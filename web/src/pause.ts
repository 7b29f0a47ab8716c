// Waiting: pauses that can be cut short, and for the page to be seen.

/** A pause that `wake` ends early; a call of `wake` before it is not lost. */
export function pauser(): { pause: (millis: number) => Promise<void>; wake: () => void } {
  let isAwake = false;
  let end: (() => void) | null = null;
  const pause = (millis: number) =>
    new Promise<void>((resolve) => {
      const timer = setTimeout(() => end?.(), isAwake ? 0 : millis);
      isAwake = false;
      end = () => {
        clearTimeout(timer);
        end = null;
        resolve();
      };
    });
  const wake = () => {
    if (end) end();
    else isAwake = true;
  };
  return { pause, wake };
}

/** Resolves once the page can be seen. */
export function seen(): Promise<void> {
  if (!document.hidden) return Promise.resolve();
  return new Promise((resolve) => document.addEventListener("visibilitychange", () => resolve(), { once: true }));
}
