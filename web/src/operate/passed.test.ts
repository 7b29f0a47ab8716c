// Tracks of several cameras at one place are one person, who keeps their name from camera to camera.

import { expect, test } from "vitest";
import { type Track, positionAt, renamed, sightingsAt } from "./passed";

const along = (camera: string, track: number, began: number, ended: number, y = 0): Track => ({
  camera, track, began, ended,
  path: Array.from({ length: (ended - began) / 1e3 + 1 }, (_, i) => ({ at: began + i * 1e3, position: [(began / 1e3 + i) * 1.5, y, 0] as const })),
});

test("between two points of a path it is on the straight way", () => {
  const track = along("west", 1, 0, 4_000);
  expect(positionAt(track, 1_500)?.[0]).toBeCloseTo(2.25, 9);
  expect(positionAt(track, 4_001)).toBeNull();
  expect(positionAt({ ...track, path: [{ at: 0, position: null }] }, 100)).toBeNull();
});

test("what two cameras see at one place is one, what one camera sees twice is two", () => {
  const tracks = [along("west", 1, 0, 4_000), along("east", 9, 2_000, 8_000, 0.4), along("west", 2, 0, 4_000, 0.5)];
  const found = sightingsAt(tracks, 3_000);
  expect(found.map(({ id, cameras }) => [id, cameras])).toEqual([["west:1", ["west", "east"]], ["west:2", ["west"]]]);
});

test("whoever is followed keeps the name when the first camera has lost them", () => {
  const tracks = [along("west", 1, 0, 4_000), along("east", 9, 2_000, 8_000)];
  const known = new Set(sightingsAt(tracks, 3_000)[0]?.members);
  const later = sightingsAt(tracks, 6_000);
  expect(later[0]?.id).toBe("east:9");
  expect(renamed(later, "west:1", known)[0]?.id).toBe("west:1");
  expect(renamed(later, null, known)[0]?.id).toBe("east:9");
});
