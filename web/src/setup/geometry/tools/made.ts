// A finished drawing as a thing of the document.

import { tidy, tidyTurn } from "../operations";
import { distance, turned } from "../outline";
import { type Thing, COLOR } from "../things";
import { type Drawing, outlineOf } from "./drawing";

function box({ corners: [a = [0, 0], b = [0, 0]], yaw, base, height }: Drawing, id: string): Thing {
  const [x, y] = turned(b, a, -yaw);
  const center = turned([(a[0] + x) / 2, (a[1] + y) / 2], a, yaw);
  const size_m = [Math.abs(x - a[0]), Math.abs(y - a[1]), height].map(tidy);
  return { list: "boxes", of: { id, center_m: [...center, base + height / 2].map(tidy), size_m, yaw_deg: tidyTurn(yaw), color_srgb: COLOR } };
}

/** A wall along one line is a thin box, which can be turned and stretched as such; along several, a footprint. */
function wall(of: Drawing, id: string): Thing {
  const { corners, thickness, base, height } = of;
  const [a = [0, 0], b = [0, 0]] = corners;
  if (corners.length !== 2) return footprint(of, id);
  const yaw = (Math.atan2(b[1] - a[1], b[0] - a[0]) * 180) / Math.PI;
  const size_m = [distance(a, b), thickness, height].map(tidy);
  const center_m = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, base + height / 2].map(tidy);
  return { list: "boxes", of: { id, center_m, size_m, yaw_deg: tidyTurn(yaw), color_srgb: COLOR } };
}

function footprint(of: Drawing, id: string): Thing {
  const polygon = outlineOf(of).map((at) => at.map(tidy));
  return { list: "footprints", of: { id, polygon, base_m: tidy(of.base), top_m: tidy(of.base + of.height), color_srgb: COLOR } };
}

/** The thing that was drawn. */
export function made(of: Drawing, id: string): Thing {
  switch (of.tool) {
    case "box":
      return box(of, id);
    case "wall":
      return wall(of, id);
    case "footprint":
      return footprint(of, id);
    case "cylinder": {
      const [at = [0, 0], rim = at] = of.corners;
      return { list: "cylinders", of: { id, base_m: [...at, of.base].map(tidy), radius_m: tidy(distance(at, rim)), height_m: tidy(of.height), color_srgb: COLOR } };
    }
  }
}
