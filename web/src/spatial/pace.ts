// How long pictures take, and how coarse they may be so that they keep up. Graphics work is done later than it is asked for: a fence
// tells when a picture is done, and none is begun before the one before it is.

/** How many device pixels a pixel of the picture takes each way. */
const COARSENESSES = [1, 1.5, 2, 3] as const;
/** What a picture may take while the viewer moves, and while they do not. */
export const BUDGET_MILLIS = { moving: 40, resting: 120 } as const;
/** Weight of the newest picture in the mean. */
const NEWEST = 0.3;
const RATE_MILLIS = 2_000;

/** The finest coarseness with which a picture, which takes `fullMillis` at its finest, keeps to a budget; it is left only for one that
 * is clearly better, since every change makes the canvas anew. */
export function coarsenessFor(fullMillis: number, budget: number, now: number): number {
  const coarsest = COARSENESSES.at(-1) ?? 1;
  const within = (room: number) => COARSENESSES.find((one) => fullMillis / (one * one) <= budget * room) ?? coarsest;
  const wanted = within(1);
  // Finer again only where there is room for it.
  return wanted < now ? Math.min(now, within(0.7)) : wanted;
}

/** Pictures a second of the last moments (at least of the last three, however slow), by when each was done. */
export function rateOf(doneAt: readonly number[], now: number): number {
  const recent = doneAt.filter((at, i) => now - at <= RATE_MILLIS || i >= doneAt.length - 3);
  const [first] = recent;
  const last = recent.at(-1);
  return first === undefined || last === undefined || recent.length < 2 ? 0 : ((recent.length - 1) * 1e3) / Math.max(1, last - first);
}

export class Pace {
  /** What a picture takes at its finest, milliseconds; 0 until one was done. */
  fullMillis = 0;
  /** How many were done. */
  count = 0;
  private pending: { sync: WebGLSync; begunAt: number; coarseness: number } | null = null;
  private done: number[] = [];

  /** A picture was asked for. */
  begun(gl: WebGL2RenderingContext, begunAt: number, coarseness: number): void {
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.pending = sync && { sync, begunAt, coarseness };
  }

  /** Whether the last picture is still being drawn. */
  isBusy(gl: WebGL2RenderingContext, now = performance.now()): boolean {
    if (!this.pending) return false;
    const { sync, begunAt, coarseness } = this.pending;
    if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) return true;
    gl.deleteSync(sync);
    this.pending = null;
    const full = (now - begunAt) * coarseness * coarseness;
    // The first one compiles its programs.
    this.fullMillis = this.count < 2 ? full : this.fullMillis + NEWEST * (full - this.fullMillis);
    this.count += 1;
    this.done = [...this.done, now].slice(-120);
    return false;
  }

  /** Waits for no picture any more. */
  forget(gl: WebGL2RenderingContext): void {
    if (this.pending) gl.deleteSync(this.pending.sync);
    this.pending = null;
  }

  /** Pictures a second, lately. */
  rate(now = performance.now()): number {
    return rateOf(this.done, now);
  }
}
