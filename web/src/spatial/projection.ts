// Cameras' pictures projected on a scene's surfaces, as the daemon draws them. `draw` is to be called before each picture (give it to
// `stage.beforeDraw` by `attach`): what did not change costs nothing there.

import { Vector3, Vector4, type WebGLRenderer } from "three";
import type { Point } from "../operate/orbit";
import type { CameraTexture } from "./cameraTextures";
import { MOST_PROJECTED, mostUseful } from "./choosing";
import { DepthMaps, facesOf } from "./depthMaps";
import type { Lens } from "./lens";
import { lensDefines, lensUniform } from "./lensShader";
import { PictureLayers } from "./pictureLayers";
import type { Stage } from "./stage";
import type { Surfaces } from "./surfaces";
import { fromThree } from "./world";

/** A camera whose picture is projected. A changed one is another object; one with the same lens object keeps its depth map. */
export type Projector = {
  readonly id: string;
  readonly lens: Lens;
  readonly picture: CameraTexture;
  /** 0 to 1; 1 if absent. */
  readonly opacity?: number;
  /** What its colours are multiplied by, in linear light. */
  readonly gain?: Point;
};

/** Places of the picture at which is asked which camera sees what. */
const PROBES = [[0, 0], [-0.6, 0], [0.6, 0], [0, -0.6], [0, 0.6], [-0.6, -0.6], [0.6, -0.6], [-0.6, 0.6], [0.6, 0.6]] as const;
/** While nothing else changes, cameras are chosen anew no more often. */
const CHOOSE_MILLIS = 400;

export class Projection {
  /** Whether pictures end at what hides; off it is as if nothing hid anything. */
  hides = true;
  private projectors: readonly Projector[] = [];
  private solo: string | null = null;
  private shown: readonly Projector[] = [];
  private readonly layers = new PictureLayers();
  private readonly depthMaps = new DepthMaps();
  private readonly depthsOf = new Map<number, { lens: Lens; version: number }>();
  private chosenAt = -Infinity;
  private isStale = true;
  private detach: (() => void) | null = null;

  constructor(private readonly surfaces: Surfaces) {}

  /** Projects these from now on. */
  set(projectors: readonly Projector[]): void {
    this.projectors = projectors;
    this.chosenAt = -Infinity;
    this.isStale = true;
  }

  /** Projects one camera alone; null all of them. */
  show(id: string | null): void {
    if (id === this.solo) return;
    this.solo = id;
    this.chosenAt = -Infinity;
    this.isStale = true;
  }

  /** Draws whatever is needed before each of the stage's pictures. */
  attach(stage: Stage): () => void {
    const prepare = (millis: number) => {
      this.draw(stage, millis);
      return false;
    };
    const restored = () => {
      this.layers.forget();
      this.depthsOf.clear();
      this.isStale = true;
    };
    stage.beforeDraw.add(prepare);
    stage.canvas.addEventListener("webglcontextrestored", restored);
    this.detach = () => {
      stage.beforeDraw.delete(prepare);
      stage.canvas.removeEventListener("webglcontextrestored", restored);
      this.detach = null;
    };
    stage.redraw();
    return this.detach;
  }

  /** Ids of the cameras whose pictures are projected now. */
  get cameras(): string[] {
    return this.shown.map(({ id }) => id);
  }

  draw(stage: Stage, millis = performance.now()): void {
    const { renderer } = stage;
    this.choose(stage, millis);
    const { shading, anchor } = this.surfaces;
    if (this.shown.length === 0) {
      shading.define({ N_LENSES: 0 });
      return;
    }
    const isLayered = this.layers.update(renderer, this.shown.map(({ picture }) => picture));
    const isHidden = this.hides && this.drawDepths(renderer, stage);
    if (!isLayered && !this.isStale && !isHidden) return;
    this.isStale = false;
    const faces = this.shown.map(({ lens }) => facesOf(lens));
    let first = 0;
    const casts = this.shown.flatMap(({ opacity = 1, gain = [1, 1, 1] }, i) => {
      const { count = 1, bounds = [0, 0, 1, 1] } = faces[i] ?? {};
      const cast = [new Vector4(i, opacity, this.hides ? count : 0, first), new Vector4(...bounds), new Vector4(...gain, 0)];
      first += count;
      return cast;
    });
    shading.share({
      lenses: { value: this.shown.flatMap(({ lens }) => lensUniform(lens, anchor)) },
      casts: { value: casts },
      pictures: { value: this.layers.texture },
      depths: { value: this.hides ? this.depthMaps.texture : null },
    });
    shading.define({
      ...lensDefines(this.shown.map(({ lens }) => lens)),
      HAS_DEPTH: this.hides ? 1 : null,
      HAS_CUBES: faces.some(({ count }) => count > 1) ? 1 : null,
      DEPTH_BIAS_SHARE: DepthMaps.bias(renderer),
    });
  }

  dispose(): void {
    this.detach?.();
    this.surfaces.shading.define({ N_LENSES: 0 });
    this.layers.dispose();
    this.depthMaps.dispose();
  }

  private choose(stage: Stage, millis: number): void {
    const able = this.projectors.filter(({ id, picture, opacity = 1 }) => picture.texture && opacity > 0 && (this.solo === null || id === this.solo));
    let next = able;
    if (able.length > MOST_PROJECTED) {
      if (millis - this.chosenAt < CHOOSE_MILLIS) return;
      this.chosenAt = millis;
      const useful = new Set(mostUseful(able, this.eye(stage), this.places(stage)));
      // In their own order, so that no layer changes its camera without need.
      next = able.filter((projector) => useful.has(projector));
    }
    if (next.length === this.shown.length && next.every((one, i) => one === this.shown[i])) return;
    this.shown = next;
    this.isStale = true;
  }

  private eye({ camera }: Stage): Point {
    const [x, y, z] = fromThree(camera.position);
    const { anchor } = this.surfaces;
    return [x + anchor[0], y + anchor[1], z + anchor[2]];
  }

  /** What the viewer sees, at some places of the picture. */
  private places(stage: Stage): { point: Point; normal: Point }[] {
    const origin = this.eye(stage);
    return PROBES.flatMap(([x, y]) => {
      const far = new Vector3(x, y, 0.5).unproject(stage.camera).sub(stage.camera.position).normalize();
      const met = this.surfaces.pick({ origin, direction: fromThree(far) });
      return met ? [{ point: met.point_m, normal: met.normal }] : [];
    });
  }

  /** Draws the depth maps of lenses that moved, or of all where surfaces changed; true where any was. */
  private drawDepths(renderer: WebGLRenderer, stage: Stage): boolean {
    const counts = this.shown.map(({ lens }) => facesOf(lens).count);
    const total = counts.reduce((sum: number, count) => sum + count, 0);
    if (this.depthMaps.reserve(renderer, total)) this.depthsOf.clear();
    const { version } = this.surfaces;
    let first = 0;
    let isAny = false;
    this.shown.forEach(({ lens }, i) => {
      const before = this.depthsOf.get(first);
      if (before?.lens !== lens || before.version !== version) {
        this.depthMaps.draw(renderer, stage.scene, lens, this.surfaces.anchor, first);
        this.depthsOf.set(first, { lens, version });
        isAny = true;
      }
      first += counts[i] ?? 1;
    });
    return isAny;
  }
}
