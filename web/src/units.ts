// Numbers as people read them.

import { say } from "./strings";

/** A length of time, roughly: 12.3 s, 4 min, 2 h. */
export function duration(seconds: number): string {
  if (seconds < 10) return say("span.seconds", { n: seconds.toFixed(1) });
  if (seconds < 100) return say("span.seconds", { n: seconds.toFixed(0) });
  if (seconds < 6_000) return say("span.minutes", { n: (seconds / 60).toFixed(0) });
  if (seconds < 172_800) return say("span.hours", { n: (seconds / 3_600).toFixed(0) });
  return say("span.days", { n: (seconds / 86_400).toFixed(0) });
}

/** Bytes with the unit that suits them. */
export function bytes(count: number): string {
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  const power = Math.min(Math.floor(Math.log2(Math.max(count, 1)) / 10), units.length - 1);
  return `${(count / 1024 ** power).toFixed(power === 0 ? 0 : 1)} ${units[power] ?? ""}`;
}

const two = (n: number) => String(n).padStart(2, "0");

/** Date and time of the machine that shows it, to the second or the millisecond. */
export function clock(millis: number, withMillis = false): string {
  const at = new Date(millis);
  const date = `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
  const time = `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
  return `${date} ${time}${withMillis ? `.${String(at.getMilliseconds()).padStart(3, "0")}` : ""}`;
}
