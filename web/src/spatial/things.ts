// The things of a scene's document, kind by kind: their shapes and pictures, which of them lies over which, and how they are dressed.

import { Color, Mesh, type Object3D, type ShaderMaterial, Vector4 } from "three";
import type { components } from "../contract.gen";
import type { Point } from "../operate/orbit";
import { type Ground, type Shaped, boxShape, cylinderShape, footprintShape, groundShape, heightShape } from "./shapes";

export type SceneDocument = components["schemas"]["Scene"];
export const KINDS = ["ground", "height_fields", "boxes", "cylinders", "footprints", "models"] as const;
export type Kind = (typeof KINDS)[number];
export type Thing<Of extends Kind = Kind> = NonNullable<SceneDocument[Of]>[number];

/** How a thing is shown beside what the document says. */
export type Style = { readonly opacity?: number; readonly glow?: readonly [color: string, share: number] | null; readonly isHidden?: boolean };

/** What may have pictures. */
export type Pictured = Pick<Thing<"boxes">, "texture" | "roof_texture"> & Pick<Thing<"ground">, "imagery">;

/** From so far away on, single precision no longer holds millimetres. */
const FAR_M = 10_000;

export const COLORS = { ground: "#8a8a84", other: "#b0a080" } as const;

export const pointOf = (numbers: readonly number[] | undefined): Point => [numbers?.[0] ?? 0, numbers?.[1] ?? 0, numbers?.[2] ?? 0];
export const isSame = (a: unknown, b: unknown) => a === b || JSON.stringify(a) === JSON.stringify(b);

export function shapeOf(kind: Exclude<Kind, "models">, thing: Thing, map: Parameters<typeof groundShape>[1] = null): Shaped {
  switch (kind) {
    case "ground": return groundShape(thing as Thing<"ground">, map);
    case "height_fields": return heightShape(thing as Thing<"height_fields">, map);
    case "boxes": return boxShape(thing as Thing<"boxes">);
    case "cylinders": return cylinderShape(thing as Thing<"cylinders">);
    case "footprints": return footprintShape(thing as Thing<"footprints">);
  }
}

/** The pictures of walls, and of roofs or ground. */
export function filesOf(kind: Exclude<Kind, "models">, thing: Thing): [string | undefined, string | undefined] {
  const { texture, roof_texture, imagery } = thing as Pictured;
  return isOpen(kind) ? [undefined, (imagery ?? texture)?.file] : [texture?.file, roof_texture?.file];
}

export const isOpen = (kind: Kind) => kind === "ground" || kind === "height_fields";

/** What of a model needs another object where it changes. */
export const unmoved = ({ id, file, up, color_srgb }: Thing<"models">) => [id, file, up, color_srgb];

/** How many pieces of ground lie below this one in its plane: later ones are seen. */
export function rankOf(ground: readonly Ground[], i: number): number {
  const extent = ({ polygon }: Ground) => [0, 1].map((axis) => {
    const along = polygon.map((corner) => corner[axis] ?? 0);
    return [Math.min(...along), Math.max(...along)] as const;
  });
  const own = ground[i];
  if (!own) return 0;
  const extents = extent(own);
  const isOver = (other: Ground) => (other.height_m ?? 0) === (own.height_m ?? 0)
    && extent(other).every(([low, high], axis) => low < (extents[axis]?.[1] ?? 0) && high > (extents[axis]?.[0] ?? 0));
  return Math.min(15, ground.slice(0, i).filter(isOver).length);
}

/** The world's origin, or a whole place in the midst of a scene that is far from it. */
export function anchorOf(document: SceneDocument): Point {
  const places = [
    ...(document.ground ?? []).flatMap(({ polygon }) => polygon),
    ...(document.boxes ?? []).map(({ center_m }) => center_m),
    ...(document.footprints ?? []).flatMap(({ polygon }) => polygon),
    ...(document.height_fields ?? []).map(({ low_m }) => low_m),
    ...(document.cylinders ?? []).map(({ base_m }) => base_m),
    ...(document.models ?? []).map(({ position_m }) => pointOf(position_m)),
  ];
  const middle = [0, 1].map((axis) => {
    const along = places.map((place) => place[axis] ?? 0);
    return along.length > 0 ? (Math.min(...along) + Math.max(...along)) / 2 : 0;
  });
  const [x = 0, y = 0] = middle;
  return Math.hypot(x, y) < FAR_M ? [0, 0, 0] : [Math.round(x), Math.round(y), 0];
}

export function keyOf(object: Object3D | null): string {
  for (let at = object; at; at = at.parent) if (typeof at.userData["key"] === "string") return at.userData["key"];
  return "";
}

export function dress(object: Object3D, { opacity = 1, glow = null, isHidden = false }: Style): void {
  object.visible = !isHidden;
  const light = glow ? new Color(glow[0]) : new Color();
  object.traverse((part) => {
    if (!(part instanceof Mesh)) return;
    for (const material of [part.material as ShaderMaterial | ShaderMaterial[]].flat()) {
      const { uniforms } = material;
      if (uniforms["opacity"]) uniforms["opacity"].value = opacity;
      if (uniforms["glow"]) uniforms["glow"].value = new Vector4(light.r, light.g, light.b, glow?.[1] ?? 0);
      material.transparent = opacity < 1;
      material.depthWrite = opacity >= 1;
    }
  });
}
