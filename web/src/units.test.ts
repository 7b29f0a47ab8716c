// Lengths of time and bytes have the unit that suits them.

import { expect, test } from "vitest";
import { bytes, clock, duration } from "./units";

test("durations", () => {
  expect([0.04, 12.3, 240, 7_200, 400_000].map(duration)).toEqual(["0.0 s", "12 s", "4 min", "2 h", "5 d"]);
});

test("bytes", () => {
  expect([0, 1_023, 1_536, 5 * 1024 ** 3].map(bytes)).toEqual(["0 B", "1023 B", "1.5 KiB", "5.0 GiB"]);
});

test("clock", () => {
  expect(clock(new Date(2026, 2, 1, 12, 0, 5, 40).getTime(), true)).toBe("2026-03-01 12:00:05.040");
});
