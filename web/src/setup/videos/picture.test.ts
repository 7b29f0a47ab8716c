// A picture that is enlarged stays where it is held, and within its window; times read as people write them.

import { expect, test } from "vitest";
import { timecode } from "./Scrubber";
import { zoomed } from "./Zoomed";

test("what is under the pointer stays there while a picture is enlarged", () => {
  const twice = zoomed({ factor: 1, x: 0, y: 0 }, 2, 0.25, 0.5);
  expect(twice).toEqual({ factor: 2, x: -0.25, y: -0.5 });
  // The place of the picture that lay at 0.25 lies there still.
  expect((0.25 - twice.x) / twice.factor).toBe(0.25);
  expect(zoomed(twice, 0.1, 0.9, 0.9)).toEqual({ factor: 1, x: 0, y: 0 });
  expect(zoomed(twice, 100, 0, 0).factor).toBe(8);
});

test("times are read in hours, minutes and seconds", () => {
  expect([0, 2.5, 59.999, 75.25, 3_723.456].map(timecode)).toEqual(["0:00.00", "0:02.50", "1:00.00", "1:15.25", "1:02:03.46"]);
});
