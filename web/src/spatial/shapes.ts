// What stands in a scene as triangles, counter-clockwise seen from outside or above: the twin of src/geometry/surface. Each shape is
// relative to a place of its own, so that it can be moved without being made anew.

import { BufferAttribute, BufferGeometry, ShapeUtils, Vector2 } from "three";
import type { components } from "../contract.gen";
import type { Point } from "../operate/orbit";
import type { Pair } from "./distortion";

type Scene = components["schemas"]["Scene"];
type Of<Name extends keyof Scene> = NonNullable<Scene[Name]> extends (infer Item)[] ? Item : never;
export type Ground = Of<"ground">;
export type Box = Of<"boxes">;
export type Cylinder = Of<"cylinders">;
export type Footprint = Of<"footprints">;
export type HeightField = Of<"height_fields">;
export type Model = Of<"models">;

/** Which picture a triangle has: those of walls, of roofs (and ground), none. */
export const PARTS = { wall: 0, level: 1, plain: 2 } as const;
type Part = (typeof PARTS)[keyof typeof PARTS];

/** A shape, its place in the world and its turn from east towards north, radians. */
export type Shaped = { readonly geometry: BufferGeometry; readonly place: Point; readonly yaw: number };
/** Homogeneous texture coordinates of a place in the world. */
export type MapLevel = (x: number, y: number) => [number, number, number];

const CYLINDER_SIDES = 128;
const DEGREE = Math.PI / 180;
const pairs = (corners: readonly (readonly number[])[]): Pair[] => corners.map(([x = 0, y = 0]) => [x, y]);
const point = ([x = 0, y = 0, z = 0]: readonly number[]): Point => [x, y, z];

/** Gathers triangles. Texture coordinates come from the upper left corner of a picture, whose rows run downwards. */
class Triangles {
  private readonly corners: number[][] = [[], [], []];
  private readonly normals: number[][] = [[], [], []];
  private readonly coords: number[][] = [[], [], []];

  add(part: Part, normal: Point, corners: readonly Point[], coords: readonly (readonly [number, number, number])[]): void {
    for (const corner of corners) {
      this.corners[part]?.push(...corner);
      this.normals[part]?.push(...normal);
    }
    for (const coord of coords) this.coords[part]?.push(...coord);
  }

  /** An upright wall from `a` to `b`, which go from left to right seen from outside; `from` to `to` of the picture's repetitions. */
  wall([ax, ay]: Pair, [bx, by]: Pair, low: number, high: number, from: number, to: number, rise: number): void {
    const length = Math.hypot(bx - ax, by - ay);
    if (!(length > 0)) return;
    const outwards: Point = [(by - ay) / length, (ax - bx) / length, 0];
    const [a, b, c, d]: [Point, Point, Point, Point] = [[ax, ay, low], [bx, by, low], [bx, by, high], [ax, ay, high]];
    this.add(PARTS.wall, outwards, [a, b, c, a, c, d], [[from, 0, 1], [to, 0, 1], [to, -rise, 1], [from, 0, 1], [to, -rise, 1], [from, -rise, 1]]);
  }

  geometry(): BufferGeometry {
    const geometry = new BufferGeometry();
    const flat = (lists: number[][], size: number) => new BufferAttribute(new Float32Array(lists.flat()), size);
    geometry.setAttribute("position", flat(this.corners, 3));
    geometry.setAttribute("normal", flat(this.normals, 3));
    geometry.setAttribute("coord", flat(this.coords, 3));
    let start = 0;
    this.corners.forEach((list, part) => {
      if (list.length > 0) geometry.addGroup(start, list.length / 3, part);
      start += list.length / 3;
    });
    geometry.computeBoundingSphere();
    geometry.computeBoundingBox();
    return geometry;
  }
}

/** The corners, counter-clockwise. */
export function leftward(corners: readonly Pair[]): Pair[] {
  const double = corners.reduce((sum, [x, y], i) => {
    const [nx, ny] = corners[(i + 1) % corners.length] ?? [0, 0];
    return sum + x * ny - nx * y;
  }, 0);
  return double < 0 ? [...corners].reverse() : [...corners];
}

/** Triangles of an outline without holes, counter-clockwise. */
function ears(corners: readonly Pair[]): [Pair, Pair, Pair][] {
  const faces = ShapeUtils.triangulateShape(corners.map(([x, y]) => new Vector2(x, y)), []);
  return faces.map((face) => {
    const [a, b, c] = leftward(face.map((i) => corners[i] ?? [0, 0]));
    return [a ?? [0, 0], b ?? [0, 0], c ?? [0, 0]];
  });
}

function lowest(corners: readonly Pair[]): Pair {
  return [Math.min(...corners.map(([x]) => x)), Math.min(...corners.map(([, y]) => y))];
}

/** Repetitions of a picture over what is level, from a corner on. */
const repeated = (size: readonly number[] | undefined, [x, y]: Pair): [number, number, number] => [x / (size?.[0] ?? 1), -y / (size?.[1] ?? 1), 1];

/** A level polygon; `map`, in world coordinates, where imagery lies on it. */
export function groundShape({ polygon, height_m = 0, texture }: Ground, map: MapLevel | null = null): Shaped {
  const outline = leftward(pairs(polygon));
  const [x, y] = lowest(outline);
  const triangles = new Triangles();
  for (const ear of ears(outline.map((corner): Pair => [corner[0] - x, corner[1] - y]))) {
    const coords = ear.map((corner) => (map ? map(corner[0] + x, corner[1] + y) : repeated(texture?.size_m, corner)));
    triangles.add(PARTS.level, [0, 0, 1], ear.map((corner): Point => [...corner, 0]), coords);
  }
  return { geometry: triangles.geometry(), place: [x, y, height_m], yaw: 0 };
}

/** Uneven ground: every cell is two triangles, split from south-west to north-east. */
export function heightShape({ low_m, step_m, columns, heights_m, texture }: HeightField, map: MapLevel | null = null): Shaped {
  const [x = 0, y = 0] = low_m;
  const base = heights_m[0] ?? 0;
  const rows = Math.floor(heights_m.length / columns);
  const triangles = new Triangles();
  const at = (column: number, row: number): Point => [column * step_m, row * step_m, (heights_m[row * columns + column] ?? 0) - base];
  const coord = ([px, py]: Point) => (map ? map(px + x, py + y) : repeated(texture?.size_m, [px, py]));
  for (let row = 0; row + 1 < rows; row += 1) {
    for (let column = 0; column + 1 < columns; column += 1) {
      const [a, b, c, d] = [at(column, row), at(column + 1, row), at(column + 1, row + 1), at(column, row + 1)];
      for (const corners of [[a, b, c], [a, c, d]] as const) {
        triangles.add(PARTS.level, normalOf(...corners), corners, corners.map(coord));
      }
    }
  }
  return { geometry: triangles.geometry(), place: [x, y, base], yaw: 0 };
}

function normalOf([ax, ay, az]: Point, [bx, by, bz]: Point, [cx, cy, cz]: Point): Point {
  const [ux, uy, uz, vx, vy, vz] = [bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az];
  const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}

/** An outline drawn upwards. */
function prism(triangles: Triangles, outline: readonly Pair[], [low, high]: Pair, walls: readonly number[] | undefined, roof: readonly number[] | undefined): void {
  const corner = lowest(outline);
  const on = ([x, y]: Pair) => repeated(roof, [x - corner[0], y - corner[1]]);
  for (const ear of ears(outline)) {
    triangles.add(PARTS.level, [0, 0, 1], ear.map((place): Point => [...place, high]), ear.map(on));
    triangles.add(PARTS.plain, [0, 0, -1], [...ear].reverse().map((place): Point => [...place, low]), ear.map(() => [0, 0, 1] as const));
  }
  outline.forEach((a, i) => {
    const b = outline[(i + 1) % outline.length] ?? a;
    triangles.wall(a, b, low, high, 0, Math.hypot(b[0] - a[0], b[1] - a[1]) / (walls?.[0] ?? 1), (high - low) / (walls?.[1] ?? 1));
  });
}

/** An upright box, around its middle. */
export function boxShape({ center_m, size_m, yaw_deg = 0, texture, roof_texture }: Box): Shaped {
  const [x, y, z] = point(size_m.map((extent) => extent / 2));
  const triangles = new Triangles();
  prism(triangles, [[-x, -y], [x, -y], [x, y], [-x, y]], [-z, z], texture?.size_m, roof_texture?.size_m);
  return { geometry: triangles.geometry(), place: point(center_m), yaw: yaw_deg * DEGREE };
}

/** An outline of a building, relative to its outline's south-western corner and its under side. */
export function footprintShape({ polygon, base_m = 0, top_m, texture, roof_texture }: Footprint): Shaped {
  const outline = leftward(pairs(polygon));
  const [x, y] = lowest(outline);
  const triangles = new Triangles();
  prism(triangles, outline.map((corner): Pair => [corner[0] - x, corner[1] - y]), [0, top_m - base_m], texture?.size_m, roof_texture?.size_m);
  return { geometry: triangles.geometry(), place: [x, y, base_m], yaw: 0 };
}

/** An upright cylinder, above the middle of its lower cap. */
export function cylinderShape({ base_m, radius_m, height_m, texture, roof_texture }: Cylinder): Shaped {
  const triangles = new Triangles();
  const spoke = (i: number): Pair => {
    const angle = (2 * Math.PI * (i % CYLINDER_SIDES)) / CYLINDER_SIDES;
    return [Math.cos(angle) * radius_m, Math.sin(angle) * radius_m];
  };
  // Stretched to whole repetitions around.
  const around = Math.max(1, Math.round((2 * Math.PI * radius_m) / (texture?.size_m[0] ?? 1)));
  const rise = height_m / (texture?.size_m[1] ?? 1);
  const on = ([x, y]: Pair) => repeated(roof_texture?.size_m, [x + radius_m, y + radius_m]);
  for (let i = 0; i < CYLINDER_SIDES; i += 1) {
    const [a, b] = [spoke(i), spoke(i + 1)];
    triangles.wall(a, b, 0, height_m, (around * i) / CYLINDER_SIDES, (around * (i + 1)) / CYLINDER_SIDES, rise);
    const cap: Pair[] = [[0, 0], a, b];
    triangles.add(PARTS.level, [0, 0, 1], cap.map((corner): Point => [...corner, height_m]), cap.map(on));
    triangles.add(PARTS.plain, [0, 0, -1], [...cap].reverse().map((corner): Point => [...corner, 0]), cap.map(() => [0, 0, 1] as const));
  }
  return { geometry: triangles.geometry(), place: point(base_m), yaw: 0 };
}
