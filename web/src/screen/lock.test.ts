// Screens wait for each other, and not for who has gone.

import { expect, test, vi } from "vitest";
import { makeLock } from "./lock";

async function isOpen(waiting: Promise<void>): Promise<boolean> {
  let is = false;
  void waiting.then(() => (is = true));
  await vi.advanceTimersByTimeAsync(0);
  return is;
}

test("a frame is held until the others have it", async () => {
  vi.useFakeTimers();
  const lock = makeLock(() => Date.now());
  expect(await isOpen(lock.together("1", 7, 1_000))).toBe(true);
  lock.holds("a", "1", 7);
  lock.holds("b", "1", 6);
  const held = lock.together("1", 7, 1_000);
  expect(await isOpen(held)).toBe(false);
  lock.holds("b", "1", 8);
  expect(await isOpen(held)).toBe(true);
  // Of another version of the wall nobody knows what it holds.
  expect(await isOpen(lock.together("2", 9, 1_000))).toBe(true);
});

test("who keeps the others waiting is waited for once", async () => {
  vi.useFakeTimers();
  const lock = makeLock(() => Date.now());
  lock.holds("a", "1", 6);
  const held = lock.together("1", 7, 1_000);
  await vi.advanceTimersByTimeAsync(1_000);
  expect(await isOpen(held)).toBe(true);
  expect(await isOpen(lock.together("1", 8, 1_000))).toBe(true);
  lock.holds("a", "1", 8);
  const next = lock.together("1", 9, 1_000);
  expect(await isOpen(next)).toBe(false);
  lock.gone("a");
  expect(await isOpen(next)).toBe(true);
  expect(lock.peers()).toEqual([]);
});
