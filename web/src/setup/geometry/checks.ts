// What the daemon would refuse of what stands in a scene, told at its place before anything is saved: the twin of src/scene/read.rs
// and src/scene/shapes.rs. Texts are keys, since these are the page's own words.

import type { SceneDocument } from "../draft";
import { isId } from "../ids";
import { area, corner, edges, firstCrossing, firstRepeat } from "./outline";
import { type Texture, type Thing, extentOf, things } from "./things";

export type Check = {
  /** The thing, and the field behind its pointer, such as `polygon/2`. */
  readonly id: string;
  readonly field: string;
  readonly key:
    | "id" | "taken" | "number" | "extent" | "far" | "turn" | "scale" | "corners" | "repeat" | "crossing" | "area" | "heights" | "repeats";
  readonly values?: Readonly<Record<string, number>>;
};

const FARTHEST_M = 1e8;
const EXTENT_M = [1e-3, 1e5] as const;
const MOST_CORNERS = 1024;
const MOST_REPEATS = 4096;

type Found = Omit<Check, "id">;
const within = (value: number, [low, high]: readonly [number, number]) => value >= low && value <= high;

function far(field: string, places: readonly (number | undefined)[]): Found[] {
  return places.flatMap((value, i) => (value !== undefined && !(Math.abs(value) <= FARTHEST_M) ? [{ field: `${field}/${i}`, key: "far" as const }] : []));
}

function extent(field: string, value: number | undefined): Found[] {
  return value === undefined || !within(value, EXTENT_M) ? [{ field, key: "extent" }] : [];
}

function turn(yaw: number | undefined): Found[] {
  return yaw !== undefined && !within(yaw, [-360, 360]) ? [{ field: "yaw_deg", key: "turn" }] : [];
}

/** What is wrong with an outline, as of a footprint's `polygon`. */
export function outlineChecks(polygon: readonly (readonly number[])[]): Found[] {
  const outline = polygon.map(corner);
  if (outline.length < 3 || outline.length > MOST_CORNERS) return [{ field: "polygon", key: "corners" }];
  const distant = outline.findIndex((at) => at.some((metres) => !(Math.abs(metres) <= FARTHEST_M)));
  if (distant >= 0) return [{ field: `polygon/${distant}`, key: "far" }];
  const repeat = firstRepeat(outline);
  if (repeat !== null) return [{ field: `polygon/${repeat}`, key: "repeat", values: { corner: repeat + 1 } }];
  const crossing = firstCrossing(outline);
  if (crossing) return [{ field: `polygon/${crossing[1]}`, key: "crossing", values: { one: crossing[0] + 1, other: crossing[1] + 1 } }];
  return area(outline) === 0 ? [{ field: "polygon", key: "area" }] : [];
}

function painted(one: Thing): Found[] {
  if (one.list === "models" || one.list === "height_fields") return [];
  const { outline, low, high } = extentOf(one);
  const longest = Math.max(...edges(outline).map(([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1])));
  const across = (axis: 0 | 1) => Math.max(...outline.map((at) => at[axis])) - Math.min(...outline.map((at) => at[axis]));
  const around = one.list === "cylinders" ? 2 * Math.PI * one.of.radius_m : longest;
  const check = (field: "texture" | "roof_texture", texture: Texture | undefined, faces: readonly number[]): Found[] => {
    if (!texture) return [];
    const sizes = [0, 1].flatMap((i) => extent(`${field}/size_m/${i}`, texture.size_m[i]));
    if (sizes.length > 0) return sizes;
    const repeats = Math.max(...faces.map((metres, i) => metres / (texture.size_m[i] ?? 1)));
    return repeats > MOST_REPEATS ? [{ field: `${field}/size_m`, key: "repeats" }] : [];
  };
  return [...check("texture", one.of.texture, [around, high - low]), ...check("roof_texture", one.of.roof_texture, [across(0), across(1)])];
}

function checksOf(one: Thing): Found[] {
  switch (one.list) {
    case "boxes":
      return [...far("center_m", one.of.center_m), ...one.of.size_m.flatMap((size, i) => extent(`size_m/${i}`, size)), ...turn(one.of.yaw_deg), ...painted(one)];
    case "cylinders":
      return [...far("base_m", one.of.base_m), ...extent("radius_m", one.of.radius_m), ...extent("height_m", one.of.height_m), ...painted(one)];
    case "footprints": {
      const height = one.of.top_m - (one.of.base_m ?? 0);
      const heights: Found[] = within(height, EXTENT_M) ? [] : [{ field: "top_m", key: "heights" }];
      return [...outlineChecks(one.of.polygon), ...heights, ...painted(one)];
    }
    case "models": {
      const { scale = 1 } = one.of;
      return [...far("position_m", one.of.position_m ?? []), ...turn(one.of.yaw_deg), ...(within(scale, [1e-6, 1e6]) ? [] : [{ field: "scale", key: "scale" as const }])];
    }
    case "height_fields":
      return far("low_m", one.of.low_m);
  }
}

/** What is wrong with one thing. */
export function checkThing(one: Thing): Check[] {
  return checksOf(one).map((found) => ({ ...found, id: one.of.id }));
}

/** What is wrong with all that stands. */
export function checks(document: SceneDocument): Check[] {
  const taken = new Set<string>();
  return things(document).flatMap((one) => {
    const { id } = one.of;
    const named: Check[] = !isId(id) ? [{ id, field: "id", key: "id" }] : taken.has(id) ? [{ id, field: "id", key: "taken" }] : [];
    taken.add(id);
    return [...named, ...checkThing(one)];
  });
}
