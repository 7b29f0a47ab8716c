import type { BufferGeometry } from "three";
import { expect, test } from "vitest";
import type { Point } from "../operate/orbit";
import { boxShape, cylinderShape, footprintShape, groundShape, heightShape } from "./shapes";

/** Corners of all triangles, three by three. */
function triangles(geometry: BufferGeometry): [Point, Point, Point][] {
  const at = geometry.getAttribute("position");
  const point = (i: number): Point => [at.getX(i), at.getY(i), at.getZ(i)];
  return Array.from({ length: at.count / 3 }, (_, i) => [point(3 * i), point(3 * i + 1), point(3 * i + 2)]);
}
const cross = ([a, b, c]: [Point, Point, Point]): Point => {
  const [u, v] = [[b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]] as [Point, Point];
  return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
};
/** Of a closed shape whose triangles turn counter-clockwise seen from outside. */
const volume = (geometry: BufferGeometry) =>
  triangles(geometry).reduce((sum, corners) => sum + cross(corners).reduce((part, n, i) => part + n * (corners[0][i] ?? 0), 0) / 6, 0);

test("solids are closed, and face outwards", () => {
  expect(volume(boxShape({ id: "b", center_m: [5, 6, 7], size_m: [2, 3, 4], yaw_deg: 30 }).geometry)).toBeCloseTo(24, 4);
  const outline = [[2, 2], [9, 2], [9, 5], [5, 5], [5, 9], [2, 9]];
  expect(volume(footprintShape({ id: "f", polygon: outline, base_m: 1, top_m: 7 }).geometry)).toBeCloseTo(33 * 6, 3);
  expect(volume(footprintShape({ id: "f", polygon: [...outline].reverse(), base_m: 1, top_m: 7 }).geometry)).toBeCloseTo(33 * 6, 3);
  expect(volume(cylinderShape({ id: "c", base_m: [0, 0, 0], radius_m: 2, height_m: 5 }).geometry) / (20 * Math.PI)).toBeCloseTo(1, 2);
});

test("normals are those of the triangles", () => {
  const { geometry } = footprintShape({ id: "f", polygon: [[0, 0], [4, 1], [3, 5]], top_m: 2 });
  const normals = geometry.getAttribute("normal");
  triangles(geometry).forEach((corners, i) => {
    const [x, y, z] = cross(corners);
    const length = Math.hypot(x, y, z);
    expect(normals.getX(3 * i)).toBeCloseTo(x / length, 4);
    expect(normals.getY(3 * i)).toBeCloseTo(y / length, 4);
    expect(normals.getZ(3 * i)).toBeCloseTo(z / length, 4);
  });
});

test("ground faces upwards, either way round, and covers its area", () => {
  for (const polygon of [[[-2, -1], [2, -1], [2, 1], [-2, 1]], [[-2, 1], [2, 1], [2, -1], [-2, -1]]]) {
    const { geometry, place } = groundShape({ polygon, height_m: 3 });
    expect(place).toEqual([-2, -1, 3]);
    expect(triangles(geometry).reduce((sum, corners) => sum + cross(corners)[2] / 2, 0)).toBeCloseTo(8, 5);
  }
});

test("uneven ground is two triangles a cell, from south-west to north-east", () => {
  const { geometry } = heightShape({ id: "h", low_m: [10, 20], step_m: 2, columns: 2, heights_m: [0, 1, 2, 4] });
  expect(triangles(geometry)).toEqual([[[0, 0, 0], [2, 0, 1], [2, 2, 4]], [[0, 0, 0], [2, 2, 4], [0, 2, 2]]]);
});

test("a picture stands upright on a wall, from its lower left corner on", () => {
  const { geometry } = boxShape({ id: "b", center_m: [0, 0, 1], size_m: [4, 2, 2], texture: { file: "x", size_m: [2, 1] } });
  const [at, coord] = [geometry.getAttribute("position"), geometry.getAttribute("coord")];
  // The southern wall: its corners in the west are on the left seen from outside.
  for (let i = 0; i < 6; i += 1) {
    expect(coord.getX(i)).toBeCloseTo((at.getX(i) + 2) / 2);
    expect(coord.getY(i)).toBeCloseTo(-(at.getZ(i) + 1));
  }
});
