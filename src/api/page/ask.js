// Questions to the daemon, and what goes wrong with them as one kind of error whose message a person can read.

const PATIENCE_MILLIS = 15_000;

/** What the daemon refused, or that it did not answer (status 0). */
export class Trouble extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

/** The answer to GET `path` with `parameters` (entries without a value are left out); throws `Trouble`. */
export async function ask(path, parameters = {}) {
  const given = Object.entries(parameters).filter(([, value]) => value !== null && value !== undefined);
  const query = new URLSearchParams(given).toString();
  let response;
  try {
    const signal = AbortSignal.timeout(PATIENCE_MILLIS);
    response = await fetch(query ? `${path}?${query}` : path, { signal, cache: "no-store" });
  } catch {
    throw new Trouble("The daemon does not answer.", 0);
  }
  if (response.ok) return response;
  // A session that is over: whoever looks must log in again.
  if (response.status === 401) document.dispatchEvent(new Event("stranger"));
  const problem = await response.json().catch(() => null);
  throw new Trouble(problem?.detail ?? `The daemon answered ${response.status}.`, response.status);
}

/** Puts the picture of a response into `image` once it is decoded, and lets go of the one before. */
export async function show(image, response) {
  const url = URL.createObjectURL(await response.blob());
  const before = image.src;
  // Decoded beside the page first: an image whose own source changes may be blank for a moment.
  const next = new Image();
  next.src = url;
  try {
    await next.decode();
  } catch {
    URL.revokeObjectURL(url);
    throw new Trouble("The daemon sent a picture that cannot be read.", 200);
  }
  image.src = url;
  if (before.startsWith("blob:")) URL.revokeObjectURL(before);
}

/** A pause that `wake` ends early. */
export function pauser() {
  let wake = () => {};
  const pause = (millis) =>
    new Promise((resolve) => {
      const timer = setTimeout(resolve, millis);
      wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  return { pause, wake: () => wake() };
}

/** Resolves once the page can be seen. */
export function seen() {
  if (!document.hidden) return Promise.resolve();
  return new Promise((resolve) => document.addEventListener("visibilitychange", resolve, { once: true }));
}
