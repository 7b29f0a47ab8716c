// Frames' times survive being written; what people type is taken as they mean it, or refused.

import { expect, test } from "vitest";
import { instant, millisOf, typed } from "./moments";

test("an instant keeps its microseconds", () => {
  for (const text of ["2026-03-01T12:00:00.719222Z", "2026-03-01T12:00:00.100Z", "2026-03-01T12:00:01.000Z"]) {
    expect(instant(millisOf(text))).toBe(text);
  }
  expect(instant(millisOf("2026-11-24T16:22:37.219222096Z"))).toBe("2026-11-24T16:22:37.219222Z");
  expect(millisOf("never")).toBeNaN();
  expect(millisOf("2026-03-01T12:00:00Z")).toBe(Date.UTC(2026, 2, 1, 12));
});

test("what is typed is the viewer's own time unless it says otherwise", () => {
  const shown = new Date(2026, 2, 1, 12, 0, 0).getTime();
  const check = (text: string, expected: number) => expect(typed(text, shown), text).toEqual({ millis: expected });
  check("2026-03-01 12:00:05.25", shown + 5_250);
  check("2026-03-01T12:00", shown);
  check("2026-03-02", new Date(2026, 2, 2).getTime());
  check("2026-03-01T12:00:00Z", Date.UTC(2026, 2, 1, 12));
  check("2026-03-01 14:00:00 +02:00", Date.UTC(2026, 2, 1, 12));
  check("11:59:30", shown - 30e3);
  check("-5 min", shown - 300e3);
  check("+1.5s", shown + 1_500);
});

test("what is no time is refused", () => {
  expect(typed(" ", 0)).toEqual({ fault: "empty" });
  for (const text of ["yesterday", "12", "2026-03", "12:5"]) expect(typed(text, 0), text).toEqual({ fault: "form" });
  for (const text of ["2026-06-31 12:00", "2026-13-01", "25:00", "12:61:00"]) expect(typed(text, 0), text).toEqual({ fault: "date" });
});
