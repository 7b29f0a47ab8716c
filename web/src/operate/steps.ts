// Single frames, of a daemon that answers with the frame nearest to a time: the next and the one before, with none left out. What
// a probe answers proves what lies between: where a frame is the nearest to the middle of two others, none lies closer to it.

/** The time of a camera's frame nearest to `millis`; null where none answers for that time (a gap). */
export type Probe = (millis: number) => Promise<number | null>;
export type Direction = 1 | -1;

/** Times are told to the microsecond and kept a little less exactly. */
const SAME_MILLIS = 1.5e-3;
const MOST_PROBES = 24;
const LARGEST_GUESS_MILLIS = 4_000;

/** The frame after (or before) the one that is shown at the instant `from`; null where a gap of seconds or the end lies between.
 * `guess`: how far frames are apart, more or less, milliseconds. */
export async function nextFrame(probe: Probe, from: number, direction: Direction, guess: number): Promise<number | null> {
  const here = (await probe(from)) ?? from;
  const isBeyond: IsBeyond = (millis) => (millis - here) * direction > SAME_MILLIS;
  const found = await someBeyond(probe, here, direction, guess, isBeyond);
  return found === null ? null : nearestOf(probe, here, found, isBeyond);
}

type IsBeyond = (millis: number) => boolean;

/** Some frame beyond `here`: the guess is doubled until one answers, or a gap does. */
async function someBeyond(probe: Probe, here: number, direction: Direction, guess: number, isBeyond: IsBeyond): Promise<number | null> {
  for (let by = guess; by <= LARGEST_GUESS_MILLIS; by *= 2) {
    const found = await probe(here + direction * by);
    if (found === null) return null;
    if (isBeyond(found)) return found;
  }
  return null;
}

/** Of all frames between `here` and `found` (which is one) the nearest to `here`: looks into the middle until nothing is there. */
async function nearestOf(probe: Probe, here: number, found: number, isBeyond: IsBeyond): Promise<number> {
  let next = found;
  for (let i = 0; i < MOST_PROBES; i += 1) {
    const between = await probe((here + next) / 2);
    if (between === null || !isBeyond(between) || Math.abs(between - next) < SAME_MILLIS) break;
    next = between;
  }
  return next;
}

/** The next instant at which any of the cameras shows another frame: the least that one can go on, so that no frame of any is left
 * out. */
export async function nextInstant(probes: readonly Probe[], from: number, direction: Direction, guess: number): Promise<number | null> {
  const found = await Promise.all(probes.map((probe) => nextFrame(probe, from, direction, guess)));
  const known = found.filter((millis) => millis !== null);
  if (known.length === 0) return null;
  return direction > 0 ? Math.min(...known) : Math.max(...known);
}
