// Rights add up, and are changed one by one.

import { expect, test } from "vitest";
import { cellOf, printed, rowsOf, withRight } from "./rights";

test("what is given of all cameras is given of each", () => {
  const rights = { "*": ["live" as const], north: ["live" as const, "history" as const] };
  expect([cellOf(rights, "*", "live"), cellOf(rights, "north", "live"), cellOf(rights, "north", "history"), cellOf(rights, "west", "export")]).toEqual(["own", "all", "own", "none"]);
});

test("one is given or taken, and empty rows go", () => {
  expect(withRight({}, "north", "history", true)).toEqual({ north: ["history"] });
  expect(withRight({ north: ["history"] }, "north", "live", true)).toEqual({ north: ["live", "history"] });
  expect(withRight({ north: ["history"], "*": ["live"] }, "north", "history", false)).toEqual({ "*": ["live"] });
  expect(rowsOf({ gone: ["live"], "*": ["live"] }, ["north"])).toEqual(["*", "north", "gone"]);
  expect(printed({ north: ["live", "export"] }, (id) => id.toUpperCase())).toBe("NORTH: live, export");
});
