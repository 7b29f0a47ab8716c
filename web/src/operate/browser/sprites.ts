// People and things as upright rectangles in the scene: every fragment looks up, through its camera's lens, what that camera shows
// there of what moves (shaders/render/billboard.wgsl).

import {
  BufferAttribute, BufferGeometry, DataTexture, DoubleSide, GLSL3, Group, LinearFilter, Mesh, RedFormat, SRGBColorSpace, ShaderMaterial, Texture,
  Vector2, Vector3, Vector4,
} from "three";
import { type Lens, LENS_GLSL, lensDefines, lensUniform } from "../../spatial/lens";
import { FADED_ORDER } from "../../spatial/surfaces";
import type { Point } from "../orbit";
import type { Rectangle } from "./foreground";
import { type Upright, turnedTowards } from "./upright";

/** One that is drawn: where it stands, and what its camera shows of it. */
export type Sprite = {
  readonly upright: Upright;
  readonly place: Point;
  readonly lens: Lens;
  /** What its camera's colours are multiplied by, in linear light. */
  readonly gain: Point;
  readonly rectangle: Rectangle;
  readonly image: ImageBitmap;
  /** Columns and rows of the camera's picture. */
  readonly size: readonly [number, number];
};

/** Pixels of the camera's picture by which a rectangle is drawn larger, for the mask's soft edge. */
const EDGE_PX = 2.5;

const VERTEX = /* glsl */ `
uniform vec3 place;
uniform vec3 turnedRight;
uniform vec3 turnedUp;
uniform vec3 seenFoot;
uniform vec3 seenRight;
uniform vec3 extent; // left and right edge along the base line, height
out vec3 vSeen;
void main() {
  float along = position.x < 0.5 ? extent.x : extent.y;
  float up = position.y * extent.z;
  vec3 drawn = place + turnedRight * along + turnedUp * up;
  vSeen = seenFoot + seenRight * along + vec3(0.0, 0.0, up);
  // The world's axes to three.js's.
  gl_Position = projectionMatrix * viewMatrix * vec4(drawn.x, drawn.z, -drawn.y, 1.0);
}
`;
const FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 pc_fragColor;
#define gl_FragColor pc_fragColor
in vec3 vSeen;
uniform sampler2D picture;
uniform sampler2D mask;
uniform vec4 rect; // left, top, columns, rows of the picture
uniform vec2 size;
uniform vec3 gain;
${LENS_GLSL}
void main() {
  LensPlace seen = lensProject(0, vSeen);
  vec2 at = (seen.texture * size - rect.xy) / rect.zw;
  vec2 beside = max(max(-at, at - 1.0), vec2(0.0)) * rect.zw;
  float inside = 1.0 - smoothstep(0.0, 2.0, max(beside.x, beside.y));
  float moving = texture(mask, clamp(at, 0.0, 1.0)).r;
  float alpha = seen.isSeen ? smoothstep(0.2, 0.8, moving) * inside : 0.0;
  if (alpha <= 0.0) discard;
  gl_FragColor = vec4(texture(picture, clamp(at, 0.0, 1.0)).rgb * gain, alpha);
  #include <colorspace_fragment>
}
`;

type Board = Mesh<BufferGeometry, ShaderMaterial>;

const vector = ([x, y, z]: Point) => new Vector3(x, y, z);

export class Sprites {
  /** To be put among what stands in the world's axes. */
  readonly group = new Group();
  private readonly geometry = new BufferGeometry();
  private shown: readonly Sprite[] = [];
  private readonly meshes: Board[] = [];
  private readonly spares = new Map<Lens["distortion"]["model"], Board[]>();

  constructor() {
    this.geometry.setAttribute("position", new BufferAttribute(new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0]), 3));
  }

  /** Shows these, relative to `anchor`. Textures of those that were shown before are kept. */
  show(sprites: readonly Sprite[], anchor: Point): void {
    const before = new Map(this.shown.map((sprite, i) => [sprite.rectangle, this.meshes[i]]));
    const meshes = sprites.map((sprite) => {
      const old = before.get(sprite.rectangle);
      before.delete(sprite.rectangle);
      return old ?? this.made(sprite);
    });
    for (const mesh of before.values()) if (mesh) this.remove(mesh);
    this.meshes.splice(0, this.meshes.length, ...meshes);
    this.shown = sprites;
    meshes.forEach((mesh, i) => {
      const sprite = sprites[i];
      if (sprite) place(mesh, sprite, anchor);
    });
  }

  /** Turns all towards who looks from `eye`. */
  face(eye: Point): void {
    this.meshes.forEach(({ material: { uniforms } }, i) => {
      const sprite = this.shown[i];
      if (!sprite) return;
      const [right, up] = turnedTowards(sprite.upright.right, sprite.place, eye);
      uniforms["turnedRight"] = { value: vector(right) };
      uniforms["turnedUp"] = { value: vector(up) };
    });
  }

  /** Draws these (indices of what is shown) before what is seen through, all others after it. */
  order(hidden: ReadonlySet<number>): void {
    this.meshes.forEach((mesh, i) => (mesh.renderOrder = hidden.has(i) ? FADED_ORDER - 1 : FADED_ORDER + 1));
  }

  get count(): number {
    return this.shown.length;
  }

  dispose(): void {
    this.show([], [0, 0, 0]);
    for (const mesh of [...this.spares.values()].flat()) mesh.material.dispose();
    this.spares.clear();
    this.geometry.dispose();
    this.group.removeFromParent();
  }

  private made({ rectangle, image, lens, size }: Sprite): Board {
    const { left, top, width, height, mask } = rectangle;
    const picture = new Texture(image);
    picture.colorSpace = SRGBColorSpace;
    const covered = new DataTexture(mask, width, height, RedFormat);
    for (const texture of [picture, covered]) {
      [texture.minFilter, texture.magFilter] = [LinearFilter, LinearFilter];
      [texture.flipY, texture.generateMipmaps, texture.needsUpdate] = [false, false, true];
    }
    const mesh = this.spare(lens);
    Object.assign(mesh.material.uniforms, {
      picture: { value: picture },
      mask: { value: covered },
      rect: { value: new Vector4(left, top, width, height) },
      size: { value: new Vector2(...size) },
    });
    this.group.add(mesh);
    return mesh;
  }

  /** One that is not drawn now: programs of graphics cards are made once, not for every rectangle that comes. */
  private spare(lens: Lens): Board {
    const { model } = lens.distortion;
    const kept = this.spares.get(model)?.pop();
    if (kept) return kept;
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: DoubleSide,
      transparent: true,
      depthWrite: false,
      defines: lensDefines([lens]),
      uniforms: { turnedRight: { value: new Vector3(1, 0, 0) }, turnedUp: { value: new Vector3(0, 0, 1) } },
    });
    const mesh = new Mesh(this.geometry, material);
    mesh.userData["model"] = model;
    mesh.frustumCulled = false;
    mesh.raycast = () => {};
    return mesh;
  }

  private remove(mesh: Board): void {
    this.group.remove(mesh);
    for (const name of ["picture", "mask"]) (mesh.material.uniforms[name]?.value as Texture | undefined)?.dispose();
    const model = mesh.userData["model"] as Lens["distortion"]["model"];
    this.spares.set(model, [...(this.spares.get(model) ?? []), mesh]);
  }
}

function place(mesh: Board, { upright, place, lens, gain, size }: Sprite, anchor: Point): void {
  const from = (point: Point): Point => [point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]];
  const { foot, right, halfWidth, height } = upright;
  const distance = Math.hypot(foot[0] - lens.position[0], foot[1] - lens.position[1], foot[2] - lens.position[2]);
  const edge = (EDGE_PX * distance) / Math.min(lens.focal[0] * size[0], lens.focal[1] * size[1]);
  Object.assign(mesh.material.uniforms, {
    place: { value: vector(from(place)) },
    seenFoot: { value: vector(from(foot)) },
    seenRight: { value: vector(right) },
    extent: { value: new Vector3(-halfWidth - edge, halfWidth + edge, height + edge) },
    lenses: { value: lensUniform(lens, anchor) },
    gain: { value: vector(gain) },
  });
  // What is farther away is drawn first.
  mesh.position.copy(vector(from(place)));
}
