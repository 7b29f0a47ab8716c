// What stands in a scene, whatever its kind: found by its id, with its outline seen from above and its heights.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import type { Corner } from "../plan/frame";
import { type Outline, corner, middle, turned } from "./outline";

type Of<Name extends keyof SceneDocument> = NonNullable<SceneDocument[Name]> extends (infer Item)[] ? Item : never;
export type Box = Of<"boxes">;
export type Cylinder = Of<"cylinders">;
export type Footprint = Of<"footprints">;
export type HeightField = Of<"height_fields">;
export type Model = Of<"models">;
export type Texture = NonNullable<Box["texture"]>;

/** A thing, by the list of the document that it stands in. */
export type Thing =
  | { readonly list: "boxes"; readonly of: Box }
  | { readonly list: "cylinders"; readonly of: Cylinder }
  | { readonly list: "footprints"; readonly of: Footprint }
  | { readonly list: "height_fields"; readonly of: HeightField }
  | { readonly list: "models"; readonly of: Model };
export type List = Thing["list"];
export const LISTS = ["boxes", "cylinders", "footprints", "models", "height_fields"] as const satisfies readonly List[];

/** A thing's extent: its outline from above, and from which height to which. */
export type Extent = { readonly outline: Outline; readonly low: number; readonly high: number; readonly middle: Corner };

export const COLOR = "#b0a080";
const CIRCLE_SIDES = 48;

/** All that stands, in the order of the list that people see. */
export function things(document: SceneDocument): Thing[] {
  return LISTS.flatMap((list) => (document[list] ?? []).map((of) => ({ list, of }) as Thing));
}

export function thing(document: SceneDocument, id: string): Thing | null {
  return things(document).find(({ of }) => of.id === id) ?? null;
}

/** The JSON pointer of a thing; null where there is none of this id. */
export function pointerOf(document: SceneDocument, id: string): string | null {
  for (const list of LISTS) {
    const i = (document[list] ?? []).findIndex((of) => of.id === id);
    if (i >= 0) return `/${list}/${i}`;
  }
  return null;
}

/** The id of the thing that a JSON pointer leads to or into; null of anything else. */
export function idAt(document: SceneDocument, pointer: string): string | null {
  const [, list, index] = pointer.split("/");
  const known = LISTS.find((one) => one === list);
  return known ? (document[known]?.[Number(index)]?.id ?? null) : null;
}

export function point(of: readonly number[] | undefined): Point {
  return [of?.[0] ?? 0, of?.[1] ?? 0, of?.[2] ?? 0];
}

/** A rectangle around a middle, turned. */
export function rectangle(at: Corner, size: Corner, yawDeg = 0): Corner[] {
  const [x, y] = [size[0] / 2, size[1] / 2];
  const corners: Corner[] = [[-x, -y], [x, -y], [x, y], [-x, y]];
  return corners.map(([dx, dy]) => turned([at[0] + dx, at[1] + dy], at, yawDeg));
}

export function circle(at: Corner, radius: number, sides = CIRCLE_SIDES): Corner[] {
  return Array.from({ length: sides }, (_, i) => turned([at[0] + radius, at[1]], at, (360 * i) / sides));
}

/** The extent of a model's file in its own unit, upright: low and high corner. */
export type FileExtent = { readonly low: Point; readonly high: Point };
/** What is known of models' files; until one is read it counts as a cube of one unit. */
export type FileExtents = ReadonlyMap<string, FileExtent>;
const UNREAD: FileExtent = { low: [-0.5, -0.5, 0], high: [0.5, 0.5, 1] };

function ofModel({ file, position_m, yaw_deg = 0, scale = 1 }: Model, files: FileExtents): Extent {
  const [x, y, z] = point(position_m);
  const { low, high } = files.get(file) ?? UNREAD;
  const corners: Corner[] = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
  const outline = corners.map(([dx, dy]) => turned([x + dx * scale, y + dy * scale], [x, y], yaw_deg));
  return { outline, low: z + low[2] * scale, high: z + high[2] * scale, middle: middle(outline) };
}

function ofField({ low_m, step_m, columns, heights_m }: HeightField): Extent {
  const [x, y] = corner(low_m);
  const rows = Math.floor(heights_m.length / Math.max(columns, 1));
  const [east, north] = [x + (columns - 1) * step_m, y + (rows - 1) * step_m];
  const heights = heights_m.length > 0 ? heights_m : [0];
  const [low, high] = heights.reduce<Corner>((all, one) => [Math.min(all[0], one), Math.max(all[1], one)], [Infinity, -Infinity]);
  return { outline: [[x, y], [east, y], [east, north], [x, north]], low, high, middle: [(x + east) / 2, (y + north) / 2] };
}

export function extentOf(thing: Thing, files: FileExtents = new Map()): Extent {
  switch (thing.list) {
    case "boxes": {
      const [[x, y, z], [sx, sy, sz]] = [point(thing.of.center_m), point(thing.of.size_m)];
      return { outline: rectangle([x, y], [sx, sy], thing.of.yaw_deg), low: z - sz / 2, high: z + sz / 2, middle: [x, y] };
    }
    case "cylinders": {
      const [x, y, z] = point(thing.of.base_m);
      return { outline: circle([x, y], thing.of.radius_m), low: z, high: z + thing.of.height_m, middle: [x, y] };
    }
    case "footprints": {
      const outline = thing.of.polygon.map(corner);
      return { outline, low: thing.of.base_m ?? 0, high: thing.of.top_m, middle: middle(outline) };
    }
    case "models":
      return ofModel(thing.of, files);
    case "height_fields":
      return ofField(thing.of);
  }
}

/** The turn of what has one; null of the others. */
export function yawOf(thing: Thing): number | null {
  return thing.list === "boxes" || thing.list === "models" ? (thing.of.yaw_deg ?? 0) : null;
}

/** Every id that is taken among what stands. */
export function ids(document: SceneDocument): string[] {
  return things(document).map(({ of }) => of.id);
}
