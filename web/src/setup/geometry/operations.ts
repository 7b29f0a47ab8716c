// What is done to the things of a scene, as plain functions: a document in, the next one out; the same one where nothing changes.
// Things are meant by their ids.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import { idFrom, isId } from "../ids";
import type { Corner } from "../plan/frame";
import { corner, turned } from "./outline";
import { type Extent, type FileExtents, LISTS, type Thing, extentOf, ids, point, thing, things } from "./things";

/** Numbers as documents keep them: to a tenth of a millimetre, so that 0.1 + 0.2 is 0.3. */
export function tidy(metres: number): number {
  return Number(metres.toFixed(4)) + 0;
}

/** A turn between -180 and 180 degrees. */
export function tidyTurn(degrees: number): number {
  const whole = ((((degrees + 180) % 360) + 360) % 360) - 180;
  return Number(whole.toFixed(3)) + 0;
}

/** Changes things, whatever their kind. */
export function update(document: SceneDocument, of: readonly string[], change: (thing: Thing) => Thing): SceneDocument {
  let next = document;
  for (const list of LISTS) {
    const before = document[list] as Thing["of"][] | undefined;
    if (!before?.some(({ id }) => of.includes(id))) continue;
    const after = before.map((value) => (of.includes(value.id) ? change({ list, of: value } as Thing).of : value));
    if (after.some((value, i) => value !== before[i])) next = { ...next, [list]: after };
  }
  return next;
}

export function add(document: SceneDocument, { list, of }: Thing): SceneDocument {
  return { ...document, [list]: [...(document[list] ?? []), of] };
}

export function remove(document: SceneDocument, of: readonly string[]): SceneDocument {
  let next = document;
  for (const list of LISTS) {
    const before = document[list] as Thing["of"][] | undefined;
    const after = before?.filter(({ id }) => !of.includes(id));
    if (before && after && after.length < before.length) next = { ...next, [list]: after };
  }
  return next;
}

/** Why an id cannot be a thing's; null where it can. */
export function idFault(document: SceneDocument, id: string, next: string): "form" | "taken" | null {
  if (!isId(next)) return "form";
  return next !== id && ids(document).includes(next) ? "taken" : null;
}

export function rename(document: SceneDocument, id: string, next: string): SceneDocument {
  if (next === id || idFault(document, id, next) !== null) return document;
  return update(document, [id], (of) => ({ ...of, of: { ...of.of, id: next } }) as Thing);
}

function movedThing(of: Thing, [dx, dy, dz]: Point): Thing {
  const by = (place: readonly number[] | undefined) => {
    const [x, y, z] = point(place);
    return [tidy(x + dx), tidy(y + dy), tidy(z + dz)];
  };
  const level = (place: readonly number[]) => [tidy((place[0] ?? 0) + dx), tidy((place[1] ?? 0) + dy)];
  switch (of.list) {
    case "boxes":
      return { list: of.list, of: { ...of.of, center_m: by(of.of.center_m) } };
    case "cylinders":
      return { list: of.list, of: { ...of.of, base_m: by(of.of.base_m) } };
    case "models":
      return { list: of.list, of: { ...of.of, position_m: by(of.of.position_m) } };
    case "footprints":
      return {
        list: of.list,
        of: { ...of.of, polygon: of.of.polygon.map(level), base_m: tidy((of.of.base_m ?? 0) + dz), top_m: tidy(of.of.top_m + dz) },
      };
    case "height_fields":
      return { list: of.list, of: { ...of.of, low_m: level(of.of.low_m), heights_m: dz === 0 ? of.of.heights_m : of.of.heights_m.map((z) => tidy(z + dz)) } };
  }
}

export function move(document: SceneDocument, of: readonly string[], by: Point): SceneDocument {
  if (by.every((metres) => metres === 0)) return document;
  return update(document, of, (one) => movedThing(one, by));
}

function turnedThing(of: Thing, about: Corner, byDeg: number): Thing {
  const around = ([x, y, z]: Point): number[] => [...turned([x, y], about, byDeg).map(tidy), z];
  const yaw = (before = 0) => tidyTurn(before + byDeg);
  switch (of.list) {
    case "boxes":
      return { list: of.list, of: { ...of.of, center_m: around(point(of.of.center_m)), yaw_deg: yaw(of.of.yaw_deg) } };
    case "cylinders":
      return { list: of.list, of: { ...of.of, base_m: around(point(of.of.base_m)) } };
    case "models":
      return { list: of.list, of: { ...of.of, position_m: around(point(of.of.position_m)), yaw_deg: yaw(of.of.yaw_deg) } };
    case "footprints":
      return { list: of.list, of: { ...of.of, polygon: of.of.polygon.map((at) => turned(corner(at), about, byDeg).map(tidy)) } };
    case "height_fields":
      // Its posts stand along the axes, and cannot be turned.
      return of;
  }
}

/** Turns things about a place, degrees from east towards north. */
export function turn(document: SceneDocument, of: readonly string[], about: Corner, byDeg: number): SceneDocument {
  if (byDeg === 0) return document;
  return update(document, of, (one) => turnedThing(one, about, byDeg));
}

/** The extent of several things together: what they are turned about and scaled from. */
export function extentOfAll(document: SceneDocument, of: readonly string[], files?: FileExtents): Extent | null {
  const extents = things(document).filter((one) => of.includes(one.of.id)).map((one) => extentOf(one, files));
  const [first] = extents;
  if (!first) return null;
  if (extents.length === 1) return first;
  const places = extents.flatMap(({ outline }) => outline);
  const [xs, ys] = [places.map(([x]) => x), places.map(([, y]) => y)];
  const [low, high]: [Corner, Corner] = [[Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]];
  return {
    outline: [low, [high[0], low[1]], high, [low[0], high[1]]],
    low: Math.min(...extents.map((one) => one.low)),
    high: Math.max(...extents.map((one) => one.high)),
    middle: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2],
  };
}

/** Copies of things, beside them by `by`, with ids of their own; and those ids. */
export function duplicate(document: SceneDocument, of: readonly string[], by: Point): { document: SceneDocument; copies: string[] } {
  let next = document;
  const copies: string[] = [];
  for (const id of of) {
    const original = thing(document, id);
    if (!original) continue;
    // tree-2 becomes tree-3 rather than tree-2-2.
    const copy = idFrom(id.replace(/-\d+$/, ""), ids(next), id);
    next = add(next, movedThing({ list: original.list, of: { ...original.of, id: copy } } as Thing, by));
    copies.push(copy);
  }
  return { document: next, copies };
}
