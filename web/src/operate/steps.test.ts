// Stepping goes through every frame once, however unevenly they come and wherever it begins.

import { expect, test } from "vitest";
import { type Direction, type Probe, nextFrame, nextInstant } from "./steps";

/** A camera whose frames answer as the daemon's do: the nearest, of two as near the earlier, none farther away than a second. */
function camera(frames: readonly number[]): Probe {
  return (millis) => {
    const nearest = frames.reduce((best, frame) => (Math.abs(frame - millis) < Math.abs(best - millis) ? frame : best), Infinity);
    return Promise.resolve(Math.abs(nearest - millis) <= 1_000 ? nearest : null);
  };
}

async function walk(probe: Probe, from: number, direction: Direction, guess: number, most = 50): Promise<number[]> {
  const seen = [];
  for (let at: number | null = from; seen.length < most; ) {
    at = await nextFrame(probe, at, direction, guess);
    if (at === null) break;
    seen.push(at);
  }
  return seen;
}

const even = Array.from({ length: 20 }, (_, i) => i * 100);
const uneven = [0, 40, 45, 46, 120, 360, 400, 410, 415, 900, 901.5, 960];

test("no frame is left out or shown twice, whatever is guessed of their distance", async () => {
  for (const frames of [even, uneven]) {
    const last = frames[frames.length - 1] ?? 0;
    for (const guess of [7, 40, 100, 333, 1_000]) {
      expect(await walk(camera(frames), 0, 1, guess), `${guess}`).toEqual(frames.slice(1));
      expect(await walk(camera(frames), last, -1, guess), `${guess}`).toEqual([...frames].reverse().slice(1));
    }
  }
});

test("from a time between two frames it goes on from the one that is shown", async () => {
  expect(await nextFrame(camera(even), 130, 1, 100)).toBe(200);
  expect(await nextFrame(camera(even), 170, 1, 100)).toBe(300);
  expect(await nextFrame(camera(even), 170, -1, 100)).toBe(100);
});

test("before a gap and at the end there is none", async () => {
  expect(await nextFrame(camera([0, 100, 9_000]), 100, 1, 100)).toBeNull();
  expect(await nextFrame(camera([0, 100]), 0, -1, 100)).toBeNull();
});

test("of several cameras every frame of each is shown once, in its order", async () => {
  const cameras = [camera(even), camera(even.map((at) => at + 30)), camera(uneven)];
  const shown: (number | null)[][] = cameras.map(() => []);
  for (let at: number | null = 0; at !== null && at < 900; at = await nextInstant(cameras, at, 1, 100)) {
    for (const [i, probe] of cameras.entries()) {
      const frame = await probe(at);
      const seen = shown[i] ?? [];
      if (seen[seen.length - 1] !== frame) seen.push(frame);
    }
  }
  expect(shown[0]).toEqual(even.slice(0, shown[0]?.length));
  expect(shown[1]).toEqual(even.map((at) => at + 30).slice(0, shown[1]?.length));
  expect(shown[2]).toEqual(uneven.slice(0, shown[2]?.length));
  expect(shown[2]?.length).toBeGreaterThan(8);
});
