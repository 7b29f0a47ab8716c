import { expect, test } from "vitest";
import { decide } from "./choose";

const usual = { wish: "auto", graphics: "card", rate: null, isPast: false, isLost: false, entities: "billboards", hasEffects: false } as const;

test("left to itself the browser draws as long as it keeps up", () => {
  expect(decide(usual)).toEqual({ by: "browser", why: "measuring" });
  expect(decide({ ...usual, rate: 58 })).toEqual({ by: "browser", why: "fast" });
  expect(decide({ ...usual, rate: 9 })).toEqual({ by: "server", why: "slow" });
  expect(decide({ ...usual, graphics: "software" })).toEqual({ by: "server", why: "software" });
});

test("what is wished for is done where it can be", () => {
  expect(decide({ ...usual, wish: "server", rate: 58 }).by).toBe("server");
  expect(decide({ ...usual, wish: "browser", graphics: "software", rate: 5 })).toEqual({ by: "browser", why: "wished" });
  expect(decide({ ...usual, wish: "browser", graphics: "none" })).toEqual({ by: "server", why: "none" });
  expect(decide({ ...usual, wish: "browser", isPast: true })).toEqual({ by: "server", why: "past" });
  expect(decide({ ...usual, wish: "browser", isLost: true }).by).toBe("server");
  expect(decide({ ...usual, wish: "browser", entities: "points" }).by).toBe("server");
  expect(decide({ ...usual, wish: "browser", entities: "hulls" })).toEqual({ by: "server", why: "hulls" });
  expect(decide({ ...usual, wish: "browser", entities: "auto" })).toEqual({ by: "server", why: "auto" });
  expect(decide({ ...usual, wish: "browser", hasEffects: true })).toEqual({ by: "server", why: "effects" });
});
