// Instants as numbers, milliseconds since 1970 to the microsecond, and as texts: the interface's, and what people type.

export type Typed = { millis: number } | { fault: "empty" | "form" | "date" };

/** The instant that RFC 3339 names, with what it says beyond milliseconds; NaN where it names none. */
export function millisOf(text: string | null | undefined): number {
  const whole = Date.parse(text ?? "");
  const beyond = /\.\d{3}(\d{1,6})/.exec(text ?? "")?.[1] ?? "";
  return Number.isFinite(whole) ? whole + Number(`0.${beyond || "0"}`) : NaN;
}

/** RFC 3339 to the microsecond, so that a frame's own time means that frame. */
export function instant(millis: number): string {
  const micros = Math.round(millis * 1e3);
  const whole = Math.floor(micros / 1e3);
  const beyond = micros - whole * 1e3;
  const text = new Date(whole).toISOString();
  return beyond === 0 ? text : text.replace("Z", `${String(beyond).padStart(3, "0")}Z`);
}

const DATE = String.raw`(\d{4})-(\d{1,2})-(\d{1,2})`;
const TIME = String.raw`(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,6}))?)?`;
const ZONE = String.raw`(Z|[+-]\d{2}:?\d{2})?`;
const WHOLE = new RegExp(`^${DATE}(?:[T ]+${TIME}\\s*${ZONE})?$`, "i");
const CLOCK = new RegExp(`^${TIME}$`);
const AGO = /^([+-])\s*(\d+(?:\.\d+)?)\s*(s|min|m|h|d)$/i;
const UNIT_MILLIS: Record<string, number> = { s: 1e3, m: 60e3, min: 60e3, h: 3_600e3, d: 86_400e3 };

/** What somebody typed: a date with or without time and zone, a time of the day that is shown, or so long on or back
 * (`-5 min`). Without a zone it is the viewer's own. */
export function typed(text: string, shown: number): Typed {
  const given = text.trim();
  if (given === "") return { fault: "empty" };
  const ago = AGO.exec(given);
  if (ago) {
    const by = Number(ago[2]) * (UNIT_MILLIS[(ago[3] ?? "s").toLowerCase()] ?? 0);
    return { millis: shown + (ago[1] === "-" ? -by : by) };
  }
  const clock = CLOCK.exec(given);
  const day = new Date(shown);
  const parts = clock
    ? [day.getFullYear(), day.getMonth() + 1, day.getDate(), clock[1], clock[2], clock[3], clock[4], undefined]
    : WHOLE.exec(given)?.slice(1);
  return parts ? assembled(parts) : { fault: "form" };
}

function assembled(parts: readonly (string | number | undefined)[]): Typed {
  const [year, month, date, hour, minute, second] = parts.slice(0, 6).map((part) => Number(part ?? 0)) as [number, number, number, number, number, number];
  const fraction = Number(`0.${parts[6] ?? 0}`) * 1e3;
  const zone = parts[7];
  const at = zone === undefined ? new Date(year, month - 1, date, hour, minute, second).getTime() : Date.UTC(year, month - 1, date, hour, minute, second) - zoneMillis(String(zone));
  // Dates that are none, such as the 31st of June, come out as others.
  const isOne = month >= 1 && month <= 12 && date >= 1 && date <= new Date(year, month, 0).getDate() && hour < 24 && minute < 60 && second < 60;
  return isOne && Number.isFinite(at) ? { millis: at + fraction } : { fault: "date" };
}

function zoneMillis(zone: string): number {
  const parts = /^([+-])(\d{2}):?(\d{2})$/.exec(zone);
  if (!parts) return 0;
  return (parts[1] === "-" ? -1 : 1) * (Number(parts[2]) * 60 + Number(parts[3])) * 60e3;
}

/** The viewer's zone at a time, such as UTC+02:00. */
export function zoneName(millis: number): string {
  const minutes = -new Date(millis).getTimezoneOffset();
  const two = (n: number) => String(n).padStart(2, "0");
  const away = Math.abs(minutes);
  return minutes === 0 ? "UTC" : `UTC${minutes < 0 ? "−" : "+"}${two(Math.floor(away / 60))}:${two(away % 60)}`;
}
