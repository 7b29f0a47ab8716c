// How large models are, learnt from what is drawn of them.

import { Box3, Matrix4, Mesh, type Object3D } from "three";
import type { Point } from "../../operate/orbit";
import type { Surfaces } from "../../spatial/surfaces";
import { fileExtents, shown } from "./state";
import type { FileExtent } from "./things";

/** The extent of what hangs beneath an object, in the object's own axes. */
function within(object: Object3D): Box3 {
  object.updateWorldMatrix(true, true);
  const back = new Matrix4().copy(object.matrixWorld).invert();
  const box = new Box3();
  object.traverse((part) => {
    if (!(part instanceof Mesh)) return;
    const mesh = part as Mesh;
    mesh.geometry.computeBoundingBox();
    if (mesh.geometry.boundingBox) box.union(mesh.geometry.boundingBox.clone().applyMatrix4(new Matrix4().multiplyMatrices(back, mesh.matrixWorld)));
  });
  return box;
}

const isSame = (a: FileExtent, b: FileExtent) => [...a.low, ...a.high].every((metres, i) => Math.abs(metres - ([...b.low, ...b.high][i] ?? 0)) < 1e-4);

/** Learns the extents of models that came since. */
export function readExtents(surfaces: Surfaces): void {
  const found = (shown.value.models ?? []).flatMap(({ file, scale = 1 }, i): [string, FileExtent][] => {
    const object = surfaces.things.get(`/models/${i}`);
    const box = object && within(object);
    if (!box || box.isEmpty()) return [];
    const corner = ({ x, y, z }: { x: number; y: number; z: number }): Point => [x / scale, y / scale, z / scale];
    const extent = { low: corner(box.min), high: corner(box.max) };
    const known = fileExtents.value.get(file);
    return known && isSame(known, extent) ? [] : [[file, extent]];
  });
  if (found.length > 0) fileExtents.value = new Map([...fileExtents.value, ...found]);
}
