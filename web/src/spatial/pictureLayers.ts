// Pictures of many cameras as layers of one texture, each stretched to the layers' size, with smaller levels. A layer is drawn again
// when its picture changed.

import {
  LinearFilter, LinearMipmapLinearFilter, LinearMipmapNearestFilter, Mesh, NoBlending, OrthographicCamera, PlaneGeometry, SRGBColorSpace, Scene, ShaderMaterial, type Texture, GLSL3,
  type WebGLRenderer, WebGLArrayRenderTarget, UnsignedByteType, RGBAFormat,
} from "three";
import type { CameraTexture } from "./cameraTextures";
import { isSoftware } from "./graphics";

/** Bytes that all layers may take; their levels take a third more. */
const MOST_BYTES = 128 << 20;
const STEP_PX = 16;

const VERTEX = /* glsl */ `
out vec2 place;
void main() {
  // Row 0 of layers is the picture's upper one, as it is of the picture.
  place = 0.5 + 0.5 * position.xy;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}
`;
const FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 shown;
in vec2 place;
uniform sampler2D picture;
void main() {
  shown = vec4(texture(picture, place).rgb, 1.0);
}
`;

export class PictureLayers {
  private target: WebGLArrayRenderTarget | null = null;
  private readonly drawn = new Map<number, { from: CameraTexture; version: number }>();
  private readonly material = new ShaderMaterial({
    glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, depthTest: false, depthWrite: false, blending: NoBlending,
    uniforms: { picture: { value: null } },
  });
  private readonly quad = new Mesh(new PlaneGeometry(2, 2), this.material);
  private readonly scene = new Scene().add(this.quad);
  private readonly camera = new OrthographicCamera();

  constructor() {
    this.quad.frustumCulled = false;
  }

  get texture(): Texture | null {
    return this.target?.texture ?? null;
  }

  /** Brings the layers up to date with these pictures, the first in the first layer. True where anything changed. */
  update(renderer: WebGLRenderer, pictures: readonly CameraTexture[]): boolean {
    let isChanged = this.makeRoom(renderer, pictures);
    const { target } = this;
    if (!target) return isChanged;
    const stale = pictures.flatMap((picture, layer) => {
      const before = this.drawn.get(layer);
      return picture.texture && (before?.from !== picture || before.version !== picture.version) ? [{ picture, layer }] : [];
    });
    const before = renderer.getRenderTarget();
    const isHeadset = renderer.xr.enabled;
    renderer.xr.enabled = false;
    stale.forEach(({ picture, layer }, i) => {
      this.material.uniforms["picture"] = { value: picture.texture };
      // The smaller levels are of all layers: made once, after the last.
      target.texture.generateMipmaps = i === stale.length - 1;
      renderer.setRenderTarget(target, layer);
      renderer.render(this.scene, this.camera);
      this.drawn.set(layer, { from: picture, version: picture.version });
      isChanged = true;
    });
    if (stale.length > 0) renderer.setRenderTarget(before);
    renderer.xr.enabled = isHeadset;
    return isChanged;
  }

  /** After the graphics card lost what was drawn. */
  forget(): void {
    this.drawn.clear();
  }

  dispose(): void {
    this.target?.dispose();
    this.material.dispose();
    this.quad.geometry.dispose();
  }

  private makeRoom(renderer: WebGLRenderer, pictures: readonly CameraTexture[]): boolean {
    const count = Math.max(1, pictures.length);
    const most = (axis: 0 | 1) => Math.max(STEP_PX, ...pictures.map(({ size }) => size[axis]));
    const share = Math.min(1, Math.sqrt(MOST_BYTES / (4 * count * most(0) * most(1))));
    const [width, height] = [Math.ceil((most(0) * share) / STEP_PX) * STEP_PX, Math.ceil((most(1) * share) / STEP_PX) * STEP_PX] as const;
    const old = this.target;
    if (old && old.width === width && old.height === height && old.depth >= count) return false;
    old?.dispose();
    this.drawn.clear();
    this.target = new WebGLArrayRenderTarget(width, height, count, {
      format: RGBAFormat, type: UnsignedByteType, colorSpace: SRGBColorSpace, depthBuffer: false,
      // Between two levels is looked up where that costs nothing.
      minFilter: isSoftware(renderer.getContext()) ? LinearMipmapNearestFilter : LinearMipmapLinearFilter, magFilter: LinearFilter, generateMipmaps: true,
    });
    return true;
  }
}
