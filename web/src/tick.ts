// A clock for what tells ages.

import { signal } from "@preact/signals";

/** Changes twice a second while the page can be seen. */
export const tick = signal(0);
setInterval(() => {
  if (!document.hidden) tick.value += 1;
}, 500);
