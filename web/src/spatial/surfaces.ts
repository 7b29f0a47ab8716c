// A scene's document as objects that are drawn: ground, what stands on it, and the sky. What a change of the document leaves as it
// was is left as it is.

import { Box3, Color, Group, Mesh, type Object3D, Raycaster, type ShaderMaterial, type Texture, Vector3 } from "three";
import type { Point } from "../operate/orbit";
import { Pictures, textureOf } from "./assets";
import type { Ray } from "./lens";
import { type ModelObject, free, freeMesh, modelObject } from "./models";
import { mapOf, textureAt } from "./planeMap";
import { Shading } from "./shading";
import { PARTS, type Shaped } from "./shapes";
import { skyOf } from "./sky";
import {
  COLORS, KINDS, type Kind, type Pictured, type SceneDocument, type Style, type Thing, anchorOf, dress, filesOf, isOpen, isSame, keyOf, pointOf, rankOf, shapeOf, unmoved,
} from "./things";
import { fromThree, toThree, worldRoot } from "./world";

export { KINDS, type Kind, type SceneDocument, type Style } from "./things";

/** What a ray meets: the JSON pointer of the thing, where, and what way its surface faces. */
export type Picked = { readonly key: string; readonly point_m: Point; readonly normal: Point; readonly distance_m: number };
/** Objects of this layer hide what lies behind them from cameras. */
export const SURFACE_LAYER = 1;
type Drawn = Mesh<Shaped["geometry"], ShaderMaterial | ShaderMaterial[]>;
/** `faded` is what its opacity is multiplied by. */
type Made = { thing: Thing; rank: number; object: Object3D; style: Style; faded: number; model: ModelObject | null };
/** When things that are seen through are drawn: after what they hide, before all else that is not solid. */
export const FADED_ORDER = 3;

const kindOf = (key: string) => key.split("/")[1] as Kind;


export class Surfaces {
  /** World axes, relative to `anchor`. */
  readonly root: Group = worldRoot();
  /** By JSON pointer. What is moved or turned here is put back by `update` only where the document changed. */
  readonly things = new Map<string, Object3D>();
  readonly shading = new Shading();
  /** What objects beneath the root are relative to: the world's origin, unless the scene is far from it. */
  readonly anchor: Point;
  /** One more with every change of what stands there. */
  version = 0;
  private readonly made = new Map<string, Made>();
  private readonly pictures = new Pictures();
  private readonly raycaster = new Raycaster();
  private document: SceneDocument | null = null;
  private sky: Mesh | null = null;
  private extent: { is: readonly [Point, Point] | null } | null = null;

  constructor(document: SceneDocument, private readonly whenChanged: () => void = () => {}) {
    this.anchor = anchorOf(document);
    this.update(document);
  }

  /** Follows the document. */
  update(document: SceneDocument): void {
    const before = this.document;
    this.document = document;
    const kept = new Set<string>();
    for (const kind of KINDS) {
      (document[kind] ?? []).forEach((thing: Thing, i: number) => {
        const key = `/${kind}/${i}`;
        kept.add(key);
        const rank = kind === "ground" ? rankOf(document.ground ?? [], i) : 0;
        const old = this.made.get(key);
        if (old && old.rank === rank && isSame(old.thing, thing) && isSame(before?.origin, document.origin)) old.thing = thing;
        else this.make(key, kind, thing, rank);
      });
    }
    for (const key of [...this.made.keys()]) if (!kept.has(key)) this.remove(key);
    if (!this.sky || !isSame(before?.sky, document.sky)) this.makeSky();
    this.onChange();
  }

  /** The nearest thing that a ray of the world meets. */
  pick({ origin, direction }: Ray): Picked | null {
    const [ax, ay, az] = this.anchor;
    this.root.updateMatrixWorld();
    this.raycaster.set(toThree([origin[0] - ax, origin[1] - ay, origin[2] - az]), toThree(direction).normalize());
    const hit = this.raycaster.intersectObjects([...this.things.values()].filter((object) => object.visible), true)[0];
    if (!hit) return null;
    const [x, y, z] = fromThree(hit.point);
    const facing = hit.face?.normal.clone().transformDirection(hit.object.matrixWorld) ?? new Vector3(0, 1, 0);
    if (facing.dot(this.raycaster.ray.direction) > 0) facing.negate();
    return { key: keyOf(hit.object), point_m: [x + ax, y + ay, z + az], normal: fromThree(facing), distance_m: hit.distance };
  }

  /** What stands, and is no ground, that a ray of the world crosses before so many metres, each once. */
  crossed({ origin, direction }: Ray, reachM: number): string[] {
    const [ax, ay, az] = this.anchor;
    this.root.updateMatrixWorld();
    this.raycaster.set(toThree([origin[0] - ax, origin[1] - ay, origin[2] - az]), toThree(direction).normalize());
    this.raycaster.far = reachM;
    const standing = [...this.made].filter(([key, { object }]) => !isOpen(kindOf(key)) && object.visible).map(([, { object }]) => object);
    const hits = this.raycaster.intersectObjects(standing, true);
    this.raycaster.far = Infinity;
    return [...new Set(hits.map(({ object }) => keyOf(object)))];
  }

  /** Lets what lies behind these things shine through, by key; all others are as they were. */
  fade(opacities: ReadonlyMap<string, number>): void {
    for (const [key, made] of this.made) {
      const faded = opacities.get(key) ?? 1;
      if (faded === made.faded) continue;
      made.faded = faded;
      this.dress(made);
    }
  }

  private dress({ object, style, faded }: Made): void {
    dress(object, faded < 1 ? { ...style, opacity: (style.opacity ?? 1) * faded } : style);
    // Ground after what stands on it, so that what is hidden is not drawn before.
    const order = faded < 1 ? FADED_ORDER : isOpen(kindOf(keyOf(object))) ? 1 : 0;
    object.traverse((part) => (part.renderOrder = order));
  }

  /** Shows a thing otherwise than the document says, until told otherwise. */
  style(key: string, style: Style): void {
    const made = this.made.get(key);
    if (!made) return;
    made.style = style;
    this.dress(made);
    this.onChange();
  }

  /** Low and high corner of all that stands, in the world; null where there is nothing. */
  bounds(): readonly [Point, Point] | null {
    return (this.extent ??= { is: this.measure() }).is;
  }

  private measure(): readonly [Point, Point] | null {
    this.root.updateMatrixWorld();
    const box = new Box3();
    for (const object of this.things.values()) box.expandByObject(object);
    if (box.isEmpty()) return null;
    const [a, b] = [fromThree(box.min), fromThree(box.max)];
    const corner = (of: (p: number, q: number) => number): Point =>
      [of(a[0], b[0]) + this.anchor[0], of(a[1], b[1]) + this.anchor[1], of(a[2], b[2]) + this.anchor[2]];
    return [corner(Math.min), corner(Math.max)];
  }

  dispose(): void {
    for (const key of [...this.made.keys()]) this.remove(key);
    if (this.sky) free(this.sky);
    this.sky?.removeFromParent();
    this.pictures.dispose();
  }

  /** Makes a thing, in the object that it has already if it can be. */
  private make(key: string, kind: Kind, thing: Thing, rank: number): void {
    const old = this.made.get(key);
    const [style, faded] = [old?.style ?? {}, old?.faded ?? 1];
    if (kind === "models") {
      const model = thing as Thing<"models">;
      const isMoved = old?.model && isSame(unmoved(old.thing as Thing<"models">), unmoved(model));
      if (!isMoved) this.remove(key);
      const made = (isMoved ? old.model : null) ?? modelObject(model, this.shading, () => this.modelCame(key));
      made.rescale(model.scale ?? 1);
      this.put(made.object, pointOf(model.position_m), ((model.yaw_deg ?? 0) * Math.PI) / 180);
      this.keep(key, { thing, rank, object: made.object, style, faded, model: made });
      return;
    }
    const mesh = (old?.object as Drawn | undefined) ?? new Mesh<Shaped["geometry"], ShaderMaterial | ShaderMaterial[]>();
    if (old) freeMesh(mesh);
    const color = new Color(thing.color_srgb ?? (kind === "ground" ? COLORS.ground : COLORS.other));
    const shaped = shapeOf(kind, thing);
    mesh.geometry = shaped.geometry;
    mesh.material = this.shading.material({ color, rank, isOpen: isOpen(kind) });
    mesh.layers.enable(SURFACE_LAYER);
    this.put(mesh, shaped.place, shaped.yaw);
    const made: Made = { thing, rank, object: mesh, style, faded, model: null };
    this.keep(key, made);
    void this.paint(key, kind, made, mesh);
  }

  private keep(key: string, made: Made): void {
    made.object.userData["key"] = key;
    this.made.set(key, made);
    this.things.set(key, made.object);
    this.root.add(made.object);
    this.dress(made);
  }

  private modelCame(key: string): void {
    const made = this.made.get(key);
    if (made) this.dress(made);
    this.onChange();
  }

  private remove(key: string): void {
    const made = this.made.get(key);
    if (!made) return;
    if (made.model) made.model.dispose();
    else free(made.object);
    made.object.removeFromParent();
    this.made.delete(key);
    this.things.delete(key);
  }

  /** To be called, too, by who moves a thing by hand. */
  readonly onChange = (): void => {
    this.extent = null;
    this.version += 1;
    this.whenChanged();
  };

  private put(object: Object3D, [x, y, z]: Point, yaw: number): void {
    object.position.set(x - this.anchor[0], y - this.anchor[1], z - this.anchor[2]);
    object.rotation.z = yaw;
  }

  /** Puts its pictures on a thing, once they are there. */
  private async paint(key: string, kind: Exclude<Kind, "models">, made: Made, mesh: Drawn): Promise<void> {
    const { thing, rank } = made;
    const [wallFile, levelFile] = filesOf(kind, thing);
    const picture = (file: string | undefined) => (file === undefined ? Promise.resolve(null) : this.pictures.picture(file));
    const [wall, level] = await Promise.all([picture(wallFile), picture(levelFile)]);
    if ((!wall && !level) || this.made.get(key) !== made) return;
    const { imagery } = thing as Pictured;
    const map = imagery && level ? mapOf(imagery, level.size, this.document?.origin) : null;
    if (imagery && !map) return;
    if (map) {
      mesh.geometry.dispose();
      mesh.geometry = shapeOf(kind, thing, (x, y) => textureAt(map, [x, y])).geometry;
    }
    const plain = [mesh.material].flat()[PARTS.wall] as ShaderMaterial;
    const color = plain.uniforms["color"]?.value as Color;
    const painted = (texture: Texture | null) =>
      (texture ? this.shading.material({ color, map: texture, ends: map !== null, rank, isOpen: isOpen(kind) }) : plain);
    const materials: ShaderMaterial[] = [];
    materials[PARTS.wall] = painted(wall ? textureOf(wall.image, { repeats: true }) : null);
    materials[PARTS.level] = painted(level ? textureOf(level.image, { repeats: map === null }) : null);
    materials[PARTS.plain] = plain;
    mesh.material = materials;
    this.dress(made);
    this.onChange();
  }

  private makeSky(): void {
    const sky = this.document?.sky;
    const replace = (map: Texture | null) => {
      if (this.sky) free(this.sky);
      this.sky?.removeFromParent();
      this.sky = skyOf(sky, map);
      this.root.add(this.sky);
    };
    replace(null);
    if (!sky?.picture) return;
    void this.pictures.picture(sky.picture.file).then((picture) => {
      if (!picture || this.document?.sky !== sky) return;
      replace(textureOf(picture.image, { repeats: false, turns: true }));
      this.onChange();
    });
  }
}

/** The objects of a document. `onChange` is called whenever what is to be seen changed, pictures that came included. */
export function surfacesOf(document: SceneDocument, { onChange }: { onChange?: () => void } = {}): Surfaces {
  return new Surfaces(document, onChange);
}
