// What a file is, is told from its name and its beginning; cameras that it knows nothing of stay.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { formatOf, mergedCameras } from "./exchange";

test("files are told apart", async () => {
  const format = (name: string, text = "{}") => formatOf(new File([text], name));
  expect(await format("plaza.GLB", "glTF")).toBe("glb");
  expect(await format("plaza.gltf")).toBe("gltf");
  expect(await format("plaza.json", '{"format": "video-fields", "version": 1}')).toBe("paper");
  expect(await format("plaza.json", '{"version": 1}')).toBe("videofields");
  expect(await format("plaza.json", '{"asset": {"version": "2.0"}}')).toBe("gltf");
  await expect(format("plaza.json", "plaza")).rejects.toThrow();
});

test("cameras of the draft stay", () => {
  const calibration = { import: { file: "west.xml" } };
  const before: SceneDocument = { version: 1, cameras: [{ id: "west", calibration }, { id: "east", calibration }] };
  const other = { import: { file: "other.xml" } };
  expect(mergedCameras(before, { version: 1, cameras: [{ id: "west", calibration: other }] }).cameras)
    .toEqual([{ id: "west", calibration: other }, { id: "east", calibration }]);
  expect(mergedCameras({ version: 1 }, { version: 1 })).toEqual({ version: 1 });
});
