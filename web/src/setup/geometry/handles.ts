// What of a chosen thing can be grasped, and what dragging it does: corners and sides keep the opposite one, the top keeps the foot.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import type { Corner } from "../plan/frame";
import { move, extentOfAll, tidy, turn, update } from "./operations";
import { corner, distance, edges, middle, turned } from "./outline";
import { type Box, type Cylinder, type Extent, type FileExtents, type Footprint, type Model, type Thing, extentOf, point, thing, yawOf } from "./things";

export type Handle = {
  readonly key: string;
  readonly kind: "corner" | "side" | "vertex" | "between" | "top" | "lift" | "turn";
  readonly at: Point;
  /** Dragged level with the ground at its height, or up and down. */
  readonly way: "level" | "upright";
  /** The document, as it was when the drag began, with the handle brought here. */
  readonly apply: (document: SceneDocument, to: Point) => SceneDocument;
};

/** Nothing is made thinner than this by dragging. */
const THINNEST_M = 0.01;
const DEGREE = Math.PI / 180;

type Change<Of> = (of: Of, to: Point) => Of;

function changing<Of extends Thing["of"]>(id: string, change: Change<Of>): Handle["apply"] {
  return (document, to) => update(document, [id], (one) => ({ ...one, of: change(one.of as Of, to) }) as Thing);
}

/** A box of which one side or corner is brought to a place, measured along its own axes; the opposite one stays. */
function stretched(box: Box, [sx, sy]: Corner, to: Point): Box {
  const [x, y, z] = point(box.center_m);
  const [width, depth, height] = point(box.size_m);
  const yaw = box.yaw_deg ?? 0;
  const [ux, uy] = turned([to[0], to[1]], [x, y], -yaw);
  const along = (sign: number, size: number, off: number): Corner => {
    if (sign === 0) return [size, 0];
    const next = Math.max(off * sign + size / 2, THINNEST_M);
    return [next, (sign * (next - size)) / 2];
  };
  const [[nextWidth, dx], [nextDepth, dy]] = [along(sx, width, ux - x), along(sy, depth, uy - y)];
  const center = turned([x + dx, y + dy], [x, y], yaw);
  return { ...box, center_m: [...center.map(tidy), z], size_m: [tidy(nextWidth), tidy(nextDepth), height] };
}

function boxHandles(box: Box, { low, high }: Extent): Handle[] {
  const [x, y] = point(box.center_m);
  const [width, depth] = point(box.size_m);
  const at = ([sx, sy]: Corner): Point => [...turned([x + (sx * width) / 2, y + (sy * depth) / 2], [x, y], box.yaw_deg ?? 0), high];
  const signs: Corner[] = [[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]];
  return [
    ...signs.map((sign): Handle => {
      const kind = sign[0] !== 0 && sign[1] !== 0 ? "corner" : "side";
      return { key: `${kind}${sign.join()}`, kind, at: at(sign), way: "level", apply: changing<Box>(box.id, (of, to) => stretched(of, sign, to)) };
    }),
    {
      key: "top", kind: "top", at: [x, y, high], way: "upright",
      apply: changing<Box>(box.id, (of, to) => {
        const height = tidy(Math.max(to[2] - low, THINNEST_M));
        return { ...of, center_m: [x, y, tidy(low + height / 2)], size_m: [width, depth, height] };
      }),
    },
  ];
}

function cylinderHandles(cylinder: Cylinder, { low, high }: Extent): Handle[] {
  const [x, y] = point(cylinder.base_m);
  const ways: Corner[] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
  return [
    ...ways.map(([dx, dy]): Handle => ({
      key: `side${dx},${dy}`, kind: "side", at: [x + dx * cylinder.radius_m, y + dy * cylinder.radius_m, high], way: "level",
      apply: changing<Cylinder>(cylinder.id, (of, to) => ({ ...of, radius_m: tidy(Math.max(distance([to[0], to[1]], [x, y]), THINNEST_M)) })),
    })),
    {
      key: "top", kind: "top", at: [x, y, high], way: "upright",
      apply: changing<Cylinder>(cylinder.id, (of, to) => ({ ...of, height_m: tidy(Math.max(to[2] - low, THINNEST_M)) })),
    },
  ];
}

function footprintHandles(footprint: Footprint, { low, high, middle: inside }: Extent): Handle[] {
  const outline = footprint.polygon.map(corner);
  const level = (to: Point) => [tidy(to[0]), tidy(to[1])];
  return [
    ...outline.map((at, i): Handle => ({
      key: `vertex${i}`, kind: "vertex", at: [...at, high], way: "level",
      apply: changing<Footprint>(footprint.id, (of, to) => ({ ...of, polygon: of.polygon.map((one, j) => (j === i ? level(to) : one)) })),
    })),
    ...edges(outline).map((edge, i): Handle => ({
      key: `between${i}`, kind: "between", at: [...middle(edge), high], way: "level",
      apply: changing<Footprint>(footprint.id, (of, to) => ({ ...of, polygon: [...of.polygon.slice(0, i + 1), level(to), ...of.polygon.slice(i + 1)] })),
    })),
    {
      key: "top", kind: "top", at: [...inside, high], way: "upright",
      apply: changing<Footprint>(footprint.id, (of, to) => ({ ...of, top_m: tidy(Math.max(to[2], low + THINNEST_M)) })),
    },
  ];
}

function modelHandles(model: Model, { outline, high, middle: inside }: Extent): Handle[] {
  const [x, y, z] = point(model.position_m);
  const scale = model.scale ?? 1;
  const scaled = (factor: number) => Number((scale * Math.max(factor, 1e-3)).toPrecision(5));
  return [
    ...outline.map((at, i): Handle => ({
      key: `corner${i}`, kind: "corner", at: [...at, high], way: "level",
      apply: changing<Model>(model.id, (of, to) => ({ ...of, scale: scaled(distance([to[0], to[1]], [x, y]) / Math.max(distance(at, [x, y]), 1e-6)) })),
    })),
    {
      key: "top", kind: "top", at: [...inside, high], way: "upright",
      apply: changing<Model>(model.id, (of, to) => ({ ...of, scale: scaled((to[2] - z) / Math.max(high - z, 1e-6)) })),
    },
  ];
}

function ownHandles(one: Thing, extent: Extent): Handle[] {
  switch (one.list) {
    case "boxes":
      return boxHandles(one.of, extent);
    case "cylinders":
      return cylinderHandles(one.of, extent);
    case "footprints":
      return footprintHandles(one.of, extent);
    case "models":
      return modelHandles(one.of, extent);
    case "height_fields":
      return [];
  }
}

/** The turn that a handle at a place means, degrees from east towards north, of things whose handle begins where `turnHandle` has it. */
export function turnTo(about: Corner, to: Corner): number {
  return Math.atan2(to[1] - about[1], to[0] - about[0]) / DEGREE;
}

/** What is turned by dragging: how far out its handle lies, and its direction. */
function turnHandle(document: SceneDocument, ids: readonly string[], { outline, middle: about, high }: Extent, gap: number): Handle {
  const only = ids.length === 1 ? thing(document, ids[0] ?? "") : null;
  const yaw = (only && yawOf(only)) ?? 0;
  const out = Math.max(...outline.map((at) => turned(at, about, -yaw)[0] - about[0])) + gap;
  return {
    key: "turn", kind: "turn", at: [...turned([about[0] + out, about[1]], about, yaw), high], way: "level",
    apply: (of, to) => turn(of, ids, about, turnTo(about, [to[0], to[1]]) - yaw),
  };
}

/** What can be grasped of the chosen things. `gap`: how far beside them what turns and lifts stands, metres. */
export function handlesOf(document: SceneDocument, ids: readonly string[], gap: number, files?: FileExtents): Handle[] {
  const extent = extentOfAll(document, ids, files);
  if (!extent) return [];
  const [first] = ids;
  const only = ids.length === 1 && first !== undefined ? thing(document, first) : null;
  const lift: Handle = {
    key: "lift", kind: "lift", at: [...extent.middle, extent.high + gap], way: "upright",
    apply: (of, to) => move(of, ids, [0, 0, tidy(to[2] - extent.high - gap)]),
  };
  const isTurned = !(only && (only.list === "cylinders" || only.list === "height_fields"));
  return [
    ...(only ? ownHandles(only, extentOf(only, files)) : []),
    ...(isTurned ? [turnHandle(document, ids, extent, gap)] : []),
    lift,
  ];
}
