// Whoever was there has the id that the daemon keeps, between the first and the last step of a path.

import { expect, test } from "vitest";
import { type Path, sightingsAt, standAt } from "./passed";

const along = (id: string, began: number, ended: number, cameras: readonly string[]): Path => ({
  id, height: 1.8,
  steps: Array.from({ length: (ended - began) / 1e3 + 1 }, (_, i) => ({ at: began + i * 1e3, position: [(began / 1e3 + i) * 1.5, 0, 0] as const, cameras })),
});

test("between two steps of a path it is on the straight way, and beyond its ends nowhere", () => {
  const path = along("4", 1_000, 4_000, ["west"]);
  expect(standAt(path, 1_500)?.position[0]).toBeCloseTo(2.25, 9);
  expect([1_000, 4_000].map((at) => standAt(path, at)?.position[0])).toEqual([1.5, 6]);
  expect([999, 4_001].map((at) => standAt(path, at))).toEqual([null, null]);
});

test("everybody who was there is told with the id, the height and the cameras that are kept", () => {
  const handedOver: Path = { id: "9", height: 1.6, steps: [
    { at: 0, position: [0, 0, 0], cameras: ["west"] }, { at: 2_000, position: [2, 0, 0], cameras: ["east"] }, { at: 4_000, position: [4, 0, 0], cameras: ["east"] },
  ] };
  const paths = [along("4", 1_000, 4_000, ["west", "east"]), handedOver];
  const told = (at: number) => sightingsAt(paths, at).map(({ id, height, cameras }) => [id, height, cameras]);
  expect(told(500)).toEqual([["9", 1.6, ["west"]]]);
  expect(told(3_000)).toEqual([["4", 1.8, ["west", "east"]], ["9", 1.6, ["east"]]]);
  expect(told(5_000)).toEqual([]);
});
