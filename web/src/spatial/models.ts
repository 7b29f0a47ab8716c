// Models in files: glTF and PLY by three.js's loaders, which are fetched with the first model. Where a file is not served to
// browsers, or cannot be read, a box with its name stands in its place.

import {
  BufferAttribute, type BufferGeometry, CanvasTexture, Color, Group, Mesh, type MeshStandardMaterial, type Object3D, Sprite, SpriteMaterial, type Texture,
} from "three";
import { assetPath } from "./assets";
import { served } from "./served";
import type { Shading } from "./shading";
import { type Model, boxShape } from "./shapes";

const PLAIN = "#b0a080";
const STAND_IN_M = 2;

export type ModelObject = { readonly object: Group; readonly rescale: (scale: number) => void; readonly dispose: () => void };

/** A group at the model's origin, in world axes; its content comes later, and `onChange` is called then. */
export function modelObject(model: Model, shading: Shading, onChange: () => void): ModelObject {
  const object = new Group();
  const ending = new AbortController();
  let made: Object3D = standIn(model, shading);
  let scale = model.scale ?? 1;
  let isStandIn = true;
  object.add(made);
  const path = assetPath(model.file);
  const replace = (next: Object3D) => {
    object.remove(made);
    free(made);
    [made, isStandIn] = [next, false];
    made.scale.setScalar(scale);
    object.add(made);
    onChange();
  };
  if (path !== null) {
    load(path, model, shading, ending.signal).then(replace, () => {
      // Its stand-in stays.
    });
  }
  return {
    object,
    rescale: (to) => {
      scale = to;
      if (!isStandIn) made.scale.setScalar(to);
    },
    dispose: () => {
      ending.abort();
      free(made);
    },
  };
}

async function load(path: string, model: Model, shading: Shading, signal: AbortSignal): Promise<Object3D> {
  const isPly = /\.ply$/i.test(model.file);
  const bytes = await (await served(path, signal)).arrayBuffer();
  const isUpright = (model.up ?? (isPly ? "z" : "y")) === "z";
  const inner = isPly ? await readPly(bytes, model, shading) : await readGltf(bytes, path, shading, model);
  signal.throwIfAborted();
  if (!isUpright) inner.rotation.x = Math.PI / 2;
  return inner;
}

async function readPly(bytes: ArrayBuffer, model: Model, shading: Shading): Promise<Object3D> {
  const { PLYLoader } = await import("three/addons/loaders/PLYLoader.js");
  const geometry = new PLYLoader().parse(bytes);
  return new Group().add(surface(geometry, shading, { color: new Color(model.color_srgb ?? PLAIN) }));
}

async function readGltf(bytes: ArrayBuffer, path: string, shading: Shading, model: Model): Promise<Object3D> {
  const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
  const { scene } = await new GLTFLoader().parseAsync(bytes, path.slice(0, path.lastIndexOf("/") + 1));
  const meshes: Mesh[] = [];
  scene.traverse((object) => {
    if (object instanceof Mesh) meshes.push(object as Mesh);
  });
  for (const mesh of meshes) {
    const given = (Array.isArray(mesh.material) ? mesh.material[0] : mesh.material) as MeshStandardMaterial | undefined;
    const look = { color: given?.color ?? new Color(model.color_srgb ?? PLAIN), map: given?.map ?? null };
    const drawn = surface(mesh.geometry, shading, look);
    [mesh.geometry, mesh.material] = [drawn.geometry, drawn.material];
    mesh.layers.mask = drawn.layers.mask;
    given?.dispose();
  }
  return new Group().add(scene);
}

/** A mesh of such a geometry as surfaces are drawn: one normal a triangle, one colour. */
function surface(given: BufferGeometry, shading: Shading, { color, map = null }: { color: Color; map?: Texture | null }): Mesh {
  const geometry = given.index ? given.toNonIndexed() : given.clone();
  geometry.deleteAttribute("normal");
  geometry.computeVertexNormals();
  const count = geometry.getAttribute("position").count;
  const uv = geometry.getAttribute("uv") as BufferAttribute | undefined;
  const coords = new Float32Array(count * 3);
  for (let i = 0; i < count; i += 1) coords.set([uv?.getX(i) ?? 0, uv?.getY(i) ?? 0, 1], i * 3);
  geometry.setAttribute("coord", new BufferAttribute(coords, 3));
  const tones = geometry.getAttribute("color") as BufferAttribute | undefined;
  if (tones) {
    const plain = new Float32Array(count * 3);
    for (let i = 0; i < count; i += 1) plain.set([tones.getX(i), tones.getY(i), tones.getZ(i)], i * 3);
    geometry.setAttribute("tone", new BufferAttribute(plain, 3));
  }
  const mesh = new Mesh(geometry, shading.material({ color, map, isTinted: true, hasColors: tones !== undefined, isOpen: true }));
  mesh.layers.enable(1);
  return mesh;
}

/** A box, with the file's name over it. */
function standIn({ id, file, color_srgb }: Model, shading: Shading): Group {
  const { geometry } = boxShape({ id, center_m: [0, 0, 0], size_m: [STAND_IN_M, STAND_IN_M, STAND_IN_M] });
  const box = new Mesh(geometry, shading.material({ color: new Color(color_srgb ?? PLAIN) }));
  box.position.z = STAND_IN_M / 2;
  box.layers.enable(1);
  const name = label(file.split("/").at(-1) ?? file);
  name.position.z = STAND_IN_M * 1.4;
  return new Group().add(box, name);
}

/** A name that always faces the viewer. */
export function label(text: string): Sprite {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [512, 96];
  const context = canvas.getContext("2d");
  if (context) {
    context.font = "48px system-ui, sans-serif";
    [context.textAlign, context.textBaseline] = ["center", "middle"];
    context.fillStyle = "rgb(20 24 28 / 80%)";
    context.fillRect(0, 0, 512, 96);
    context.fillStyle = "white";
    context.fillText(text, 256, 50, 490);
  }
  const sprite = new Sprite(new SpriteMaterial({ map: new CanvasTexture(canvas), depthTest: false, sizeAttenuation: true }));
  sprite.scale.set(2.6, 0.5, 1);
  sprite.renderOrder = 2_000;
  sprite.raycast = () => {};
  return sprite;
}

/** Lets go of everything beneath an object. */
export function free(object: Object3D): void {
  object.traverse((part) => {
    if (part instanceof Sprite) {
      part.material.map?.dispose();
      part.material.dispose();
    }
    if (part instanceof Mesh) freeMesh(part as Mesh);
  });
}

/** Lets go of what a mesh is drawn with. */
export function freeMesh({ geometry, material }: Mesh): void {
  geometry.dispose();
  for (const one of [material].flat()) {
    const map = (one as { uniforms?: { map?: { value: Texture | null } } }).uniforms?.map?.value;
    map?.dispose();
    one.dispose();
  }
}
