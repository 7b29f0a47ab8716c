// Files get names that the daemon takes, and another name when they are another file.

import { expect, test } from "vitest";
import { assetName, namedFiles } from "./assets";

const bytes = (text: string) => new TextEncoder().encode(text);

test("a file's name says what it was called, and changes with what is in it", () => {
  const name = assetName("Site Plan (2).PNG", bytes("a"));
  expect(name).toMatch(/^site-plan-2-[0-9a-f]{12}\.png$/);
  expect(assetName("Site Plan (2).PNG", bytes("b"))).not.toBe(name);
  expect(assetName("Site Plan (2).PNG", bytes("a"))).toBe(name);
  expect(assetName("photo.jfif", bytes("a"), "image/jpeg")).toMatch(/\.jpg$/);
  expect(assetName("門", bytes("a"), "image/png")).toMatch(/^file-[0-9a-f]{12}\.png$/);
});

test("every file that a document names is found, once", () => {
  const polygon = [[0, 0], [1, 0], [0, 1]];
  const texture = { file: "assets/brick.png", size_m: [1, 1] };
  expect(namedFiles({
    version: 1, ground: [{ polygon, texture, imagery: { file: "aerial.jpg" } }, { polygon, imagery: { file: "assets/a.png" } }],
    boxes: [{ id: "b", center_m: [0, 0, 0], size_m: [1, 1, 1], texture }],
  })).toEqual(["assets/brick.png", "assets/a.png"]);
});
