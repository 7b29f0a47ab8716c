// Rays meet what is in front, eyes see where places are, and things stand on what is below.

import { expect, test } from "vitest";
import type { SceneDocument } from "../draft";
import { onLevel, onUpright, planEye, viewEye } from "./eye";
import { fieldHeight, meet, support } from "./pick";

const DOCUMENT: SceneDocument = {
  version: 1,
  ground: [{ polygon: [[-20, -20], [20, -20], [20, 20], [-20, 20]] }],
  boxes: [{ id: "hall", center_m: [0, 5, 2], size_m: [4, 4, 4] }],
  height_fields: [{ id: "hill", low_m: [10, 10], step_m: 2, columns: 3, heights_m: [0, 0, 0, 0, 4, 0, 0, 0, 0] }],
};
const view = viewEye({ eye: [0, -10, 2], target: [0, 0, 2], fov: 60 }, [800, 600]);

test("a view places what it sees, and its rays go back there", () => {
  expect(view.place([0, 0, 2])).toEqual([400, 300]);
  expect(view.place([0, -20, 2])).toBeNull();
  const at = view.place([2, 3, 1]) ?? [0, 0];
  const met = onLevel(view.ray(at), 1);
  expect(met?.[0]).toBeCloseTo(2);
  expect(met?.[1]).toBeCloseTo(3);
  expect(onUpright(view.ray(at), [2, 3])).toBeCloseTo(1);
  expect(view.metresPerPx([0, 0, 2])).toBeCloseTo(10 / (300 / Math.tan(Math.PI / 6)));
});

test("lines behind the eye are cut off", () => {
  expect(view.lines([[0, -30, 0], [0, -20, 0]], false)).toEqual([]);
  const [piece] = view.lines([[1, -30, 0], [1, 30, 0]], false);
  expect(piece).toHaveLength(2);
  expect(view.lines([[-1, 0, 0], [1, 0, 0], [1, 1, 0]], true)[0]).toHaveLength(4);
});

test("rays meet what is in front", () => {
  expect(meet(DOCUMENT, view.ray([400, 300]))).toMatchObject({ id: "hall", at: [0, 3, 2] });
  expect(meet(DOCUMENT, view.ray([400, 300]), { except: new Set(["hall"]) })).toBeNull();
  expect(meet(DOCUMENT, view.ray([400, 590]))?.id).toBeNull();
  expect(meet(DOCUMENT, view.ray([400, 10]))).toBeNull();
  const hill = viewEye({ eye: [12, 0, 3], target: [12, 12, 3], fov: 60 }, [800, 600]);
  const met = meet(DOCUMENT, hill.ray([400, 300]));
  expect(met?.id).toBe("hill");
  expect(met?.at[1]).toBeGreaterThan(11);
  expect(met?.at[1]).toBeLessThan(13);
  const plan = planEye({ center: [0, 5], scale: 10, size_px: [100, 100] });
  expect(meet(DOCUMENT, plan.ray([50, 50]))).toMatchObject({ id: "hall", at: [0, 5, 4] });
});

test("things stand on what is below", () => {
  expect(support(DOCUMENT, [0, 5])).toEqual({ height: 4, id: "hall" });
  expect(support(DOCUMENT, [0, 5], { except: new Set(["hall"]) })).toEqual({ height: 0, id: null });
  expect(support(DOCUMENT, [11, 11])).toEqual({ height: 2, id: "hill" });
  expect(support(DOCUMENT, [50, 50])).toEqual({ height: 0, id: null });
  const [hill] = DOCUMENT.height_fields ?? [];
  expect(hill && fieldHeight(hill, [12, 11])).toBe(2);
  expect(hill && fieldHeight(hill, [9, 11])).toBeNull();
});
