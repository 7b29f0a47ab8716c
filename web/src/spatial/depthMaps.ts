// What every camera could see at most: depth maps (shaders/render/camera_depth.wgsl), so that no picture is painted through a wall.
// One face for usual lenses, the six of a cube for wide ones.

import {
  FloatType, GLSL3, HalfFloatType, Matrix4, Mesh, NearestFilter, NoBlending, OrthographicCamera, PerspectiveCamera, PlaneGeometry, RedFormat,
  Scene, ShaderMaterial, Vector3, type WebGLRenderer, WebGLArrayRenderTarget, WebGLRenderTarget,
} from "three";
import type { Point } from "../operate/orbit";
import { type Lens, ray, turned } from "./lens";
import { DEPTH_NEAR_M } from "./projectionShader";
import { SURFACE_LAYER } from "./surfaces";
import { toThree } from "./world";

const FAR_M = 20_000;
/** Least cosine off the axis that one face covers. */
const LEAST_COSINE = 0.35;
/** Texels each way, by how many faces there are. */
const SIDES = [[4, 1_024], [12, 768], [Infinity, 512]] as const;

/** x, y and z of the faces' axes in the camera's: forward, back, right, left, down, up. */
const FACES: readonly (readonly [Point, Point, Point])[] = [
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
  [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
  [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
  [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
  [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
];

const DEPTH_VERTEX = /* glsl */ `
out float vDistance;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  vDistance = -seen.z;
  gl_Position = projectionMatrix * seen;
}
`;
const DEPTH_FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 depth;
in float vDistance;
void main() {
  depth = vec4(${DEPTH_NEAR_M} / vDistance, 0.0, 0.0, 1.0);
}
`;
const QUAD_VERTEX = "void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }";
/** Dilates steps of depth by 4 texels towards the farther side. Depth is near over distance, so that it is affine over a plane's
 * picture and a plane is known at any slope: what is nearer is before a texel where neither of their planes leads to the other. Where a
 * wall meets the ground, the ground's plane leads behind the wall. */
const DILATE_FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 dilated;
uniform highp sampler2D depth;
float at(ivec2 texel) {
  return texelFetch(depth, clamp(texel, ivec2(0), textureSize(depth, 0) - 1), 0).r;
}
float smaller(float back, float forth) {
  return abs(back) < abs(forth) ? back : forth;
}
vec2 slopeAt(ivec2 texel, float here) {
  ivec2 x = ivec2(1, 0);
  ivec2 y = ivec2(0, 1);
  return vec2(smaller(here - at(texel - x), at(texel + x) - here), smaller(here - at(texel - y), at(texel + y) - here));
}
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  float here = at(texel);
  vec2 slope = slopeAt(texel, here);
  float nearest = here;
  for (int i = 0; i < 24; i++) {
    float angle = float(i % 8) * 0.7853981633974483;
    float radius = i < 8 ? 1.5 : i < 16 ? 3.0 : 4.0;
    ivec2 offset = ivec2(round(vec2(cos(angle), sin(angle)) * radius));
    float there = at(texel + offset);
    float least = 0.02 * here;
    if (there - (here + dot(slope, vec2(offset))) <= least) continue;
    float back = there - dot(slopeAt(texel + offset, there), vec2(offset));
    if (back - here > least) nearest = max(nearest, there);
  }
  dilated = vec4(nearest, 0.0, 0.0, 1.0);
}
`;

/** The faces that a lens needs: one with its middle and half extent (tangents), or a cube. */
export function facesOf(lens: Lens): { count: 1 | 6; bounds: readonly [number, number, number, number] } {
  const cube = { count: 6, bounds: [0, 0, 1, 1] } as const;
  const steps = 16;
  const border = Array.from({ length: steps }, (_, i) => i / steps).flatMap((s) => [[s, 0], [1, s], [1 - s, 1], [0, 1 - s]] as const);
  let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const place of border) {
    const through = ray(lens, place);
    if (!through) return cube;
    const [x, y, z] = lens.axes.map((axis) => axis.reduce((sum, part, i) => sum + part * (through.direction[i] ?? 0), 0)) as [number, number, number];
    if (z < LEAST_COSINE) return cube;
    [left, right, top, bottom] = [Math.min(left, x / z), Math.max(right, x / z), Math.min(top, y / z), Math.max(bottom, y / z)];
  }
  // A texel more all around.
  const [wide, high] = [((right - left) / 2) * 1.005, ((bottom - top) / 2) * 1.005];
  return { count: 1, bounds: [(left + right) / 2, (top + bottom) / 2, wide, high] };
}

export class DepthMaps {
  private target: WebGLArrayRenderTarget | null = null;
  private scratch: WebGLRenderTarget | null = null;
  private readonly camera = new PerspectiveCamera();
  private readonly depthMaterial = new ShaderMaterial({ glslVersion: GLSL3, vertexShader: DEPTH_VERTEX, fragmentShader: DEPTH_FRAGMENT, blending: NoBlending });
  private readonly dilateMaterial = new ShaderMaterial({
    glslVersion: GLSL3, vertexShader: QUAD_VERTEX, fragmentShader: DILATE_FRAGMENT, depthTest: false, depthWrite: false, blending: NoBlending,
    uniforms: { depth: { value: null } },
  });
  private readonly quad = new Mesh(new PlaneGeometry(2, 2), this.dilateMaterial);
  private readonly quadScene = new Scene().add(this.quad);
  private readonly quadCamera = new OrthographicCamera();

  constructor() {
    this.quad.frustumCulled = false;
    this.camera.layers.set(SURFACE_LAYER);
    this.camera.matrixAutoUpdate = false;
  }

  get texture() {
    return this.target?.texture ?? null;
  }

  /** How much nearer, relative, what hides must be: numbers of half precision need more. */
  static bias(renderer: WebGLRenderer): number {
    return isPrecise(renderer) ? 1e-3 : 4e-3;
  }

  /** Makes room for so many faces; true where all are to be drawn anew. */
  reserve(renderer: WebGLRenderer, faces: number): boolean {
    const side = SIDES.find(([most]) => faces <= most)?.[1] ?? 512;
    if (this.target && this.target.depth >= faces && this.target.width === side) return false;
    this.target?.dispose();
    this.scratch?.dispose();
    const type = isPrecise(renderer) ? FloatType : HalfFloatType;
    this.target = new WebGLArrayRenderTarget(side, side, Math.max(1, faces), {
      type, format: RedFormat, minFilter: NearestFilter, magFilter: NearestFilter, generateMipmaps: false, depthBuffer: false,
    });
    this.scratch = new WebGLRenderTarget(side, side, { type, format: RedFormat, minFilter: NearestFilter, magFilter: NearestFilter, generateMipmaps: false });
    return true;
  }

  /** Draws the depths that a lens sees into the layers from `first` on. */
  draw(renderer: WebGLRenderer, scene: Scene, lens: Lens, anchor: Point, first: number): void {
    if (!this.target || !this.scratch) return;
    const { count, bounds } = facesOf(lens);
    const before = { target: renderer.getRenderTarget(), override: scene.overrideMaterial, background: scene.background };
    const isHeadset = renderer.xr.enabled;
    renderer.xr.enabled = false;
    for (let face = 0; face < count; face += 1) {
      this.place(lens, anchor, face, bounds);
      scene.overrideMaterial = this.depthMaterial;
      scene.background = null;
      renderer.setRenderTarget(this.scratch);
      renderer.setClearColor(0, 0);
      renderer.render(scene, this.camera);
      scene.overrideMaterial = null;
      this.dilateMaterial.uniforms["depth"] = { value: this.scratch.texture };
      renderer.setRenderTarget(this.target, first + face);
      renderer.render(this.quadScene, this.quadCamera);
    }
    [scene.overrideMaterial, scene.background] = [before.override, before.background];
    renderer.setRenderTarget(before.target);
    renderer.xr.enabled = isHeadset;
  }

  dispose(): void {
    this.target?.dispose();
    this.scratch?.dispose();
    this.depthMaterial.dispose();
    this.dilateMaterial.dispose();
    this.quad.geometry.dispose();
  }

  private place(lens: Lens, anchor: Point, face: number, [x, y, wide, high]: readonly [number, number, number, number]): void {
    const [right, down, ahead] = (FACES[face] ?? FACES[0] as never).map((axis) => toThree(turned(lens, axis)));
    const from = toThree([lens.position[0] - anchor[0], lens.position[1] - anchor[1], lens.position[2] - anchor[2]]);
    const matrix = new Matrix4().makeBasis(right ?? new Vector3(), (down ?? new Vector3()).negate(), (ahead ?? new Vector3()).negate()).setPosition(from);
    this.camera.matrix.copy(matrix);
    this.camera.matrixWorld.copy(matrix);
    this.camera.matrixWorldInverse.copy(matrix).invert();
    const near = DEPTH_NEAR_M;
    const { coordinateSystem } = this.camera;
    this.camera.projectionMatrix.makePerspective((x - wide) * near, (x + wide) * near, (high - y) * near, (-y - high) * near, near, FAR_M, coordinateSystem);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
  }
}

function isPrecise(renderer: WebGLRenderer): boolean {
  return renderer.extensions.has("EXT_color_buffer_float");
}
