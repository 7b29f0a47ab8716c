// A canvas with a scene in it, drawn whenever something changed and never otherwise. Knows no component and no controls.

import { type Group, PerspectiveCamera, Raycaster, SRGBColorSpace, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import type { Point, View } from "../operate/orbit";
import { SURFACE_LAYER, type Surfaces } from "./surfaces";
import { fromThree, toThree, worldRoot } from "./world";
import { graphics } from "./graphics";
import { BUDGET_MILLIS, Pace, coarsenessFor } from "./pace";
import type { Ray } from "./lens";

/** Least distance at which something is drawn, and how much nearer than the nearest surface that may be. */
const NEAR_M = [0.05, 0.2] as const;
const FARTHEST_M = 1e6;
/** How far beyond the surfaces something may stand, metres. */
const ROOM_M = 50;
/** A viewer who has not moved for so long rests. */
const STILL_MILLIS = 250;

/** What happens to the canvas: "lost" until the browser gives graphics back. */
export type Health = "fine" | "lost" | "none";

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly scene = new Scene();
  /** What is put here stands in world axes, relative to `anchor`. */
  readonly world: Group = worldRoot();
  readonly camera = new PerspectiveCamera(45, 1, 0.1, 1_000);
  /** Called before each picture, with milliseconds as of `performance.now()`; true asks for another picture after it. */
  readonly beforeDraw = new Set<(millis: number) => boolean>();
  /** Called after each picture. */
  readonly afterDraw = new Set<(millis: number) => void>();
  /** While something else holds the pointer (a gizmo), it turns no view. */
  isHeld = false;
  readonly pace = new Pace();
  /** Whether pictures may be coarser so that they keep up. */
  isPaced = false;
  /** How many device pixels a pixel of the picture takes each way: above 1 draws faster and coarser. */
  private coarseness = 1;
  private movedAt = -Infinity;
  private surfaces: Surfaces | null = null;
  private view: View = { eye: [0, -10, 5], target: [0, 0, 0], fov: 45 };
  private asked = 0;
  private isOver = false;

  constructor(readonly host: HTMLElement, private readonly onHealth: (health: Health) => void) {
    // Throws where there is no WebGL2.
    // Of fine pixels nobody sees the steps at edges, and a processor takes long to smooth them.
    const antialias = devicePixelRatio < 2 && graphics() === "card";
    this.renderer = new WebGLRenderer({ antialias, powerPreference: "high-performance", stencil: false });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.domElement.setAttribute("aria-hidden", "true");
    this.scene.add(this.world);
    this.camera.layers.enable(SURFACE_LAYER);
    host.prepend(this.renderer.domElement);
    this.renderer.domElement.addEventListener("webglcontextlost", this.lost);
    this.renderer.domElement.addEventListener("webglcontextrestored", this.restored);
    this.resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  private get gl(): WebGL2RenderingContext {
    return this.renderer.getContext() as WebGL2RenderingContext;
  }

  get anchor(): Point {
    return this.surfaces?.anchor ?? [0, 0, 0];
  }

  /** Shows these surfaces, in place of those before. */
  show(surfaces: Surfaces | null): void {
    if (surfaces === this.surfaces) return;
    this.surfaces?.root.removeFromParent();
    this.surfaces = surfaces;
    if (surfaces) this.scene.add(surfaces.root);
    this.look(this.view);
  }

  /** Looks from elsewhere. */
  look(view: View): void {
    if (view !== this.view) this.movedAt = performance.now();
    this.view = view;
    this.redraw();
  }

  /** Asks for a picture, soon. */
  redraw = (): void => {
    if (this.asked === 0 && !this.isOver) this.asked = requestAnimationFrame(this.draw);
  };

  /** Follows the size of the host. */
  resize = (): void => {
    const [width, height] = [Math.max(1, this.host.clientWidth), Math.max(1, this.host.clientHeight)];
    this.renderer.setPixelRatio(devicePixelRatio / this.coarseness);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.redraw();
  };

  /** The ray of the world beneath a place of the page. */
  rayAt(clientX: number, clientY: number): Ray {
    this.place();
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    const at = new Vector2(((clientX - box.left) / box.width) * 2 - 1, 1 - ((clientY - box.top) / box.height) * 2);
    caster.setFromCamera(at, this.camera);
    return { origin: this.view.eye, direction: fromThree(caster.ray.direction) };
  }

  /** Puts three.js's camera where the viewer is. */
  place(): void {
    const { eye, target, fov } = this.view;
    const from = (point: Point): Point => [point[0] - this.anchor[0], point[1] - this.anchor[1], point[2] - this.anchor[2]];
    toThree(from(eye), this.camera.position);
    const isUpright = Math.hypot(target[0] - eye[0], target[1] - eye[1]) < 1e-6 * Math.abs(target[2] - eye[2]);
    // Straight down, north is above.
    this.camera.up.set(0, isUpright ? 0 : 1, isUpright ? -1 : 0);
    this.camera.lookAt(toThree(from(target)));
    this.camera.fov = fov;
    [this.camera.near, this.camera.far] = this.depths();
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Where the viewer's eyes are: through a headset, where the head is. */
  get eye(): Point {
    if (!this.renderer.xr.isPresenting) return this.view.eye;
    const [x, y, z] = fromThree(new Vector3().setFromMatrixPosition(this.camera.matrixWorld));
    const { anchor } = this;
    return [x + anchor[0], y + anchor[1], z + anchor[2]];
  }

  /** Draws a headset's picture, from where it says. */
  present(millis: number): void {
    for (const prepare of this.beforeDraw) prepare(millis);
    this.renderer.render(this.scene, this.camera);
    for (const follow of this.afterDraw) follow(millis);
  }

  /** Draws now. For pictures that must be there at once, such as those of tests and snapshots. */
  drawNow(millis = performance.now()): void {
    cancelAnimationFrame(this.asked);
    this.pace.forget(this.gl);
    this.draw(millis);
  }

  dispose(): void {
    this.isOver = true;
    cancelAnimationFrame(this.asked);
    this.renderer.setAnimationLoop(null);
    this.canvas.removeEventListener("webglcontextlost", this.lost);
    this.canvas.removeEventListener("webglcontextrestored", this.restored);
    this.canvas.remove();
    this.renderer.dispose();
    // Browsers hold some sixteen contexts at most; a page that goes gives its own back at once.
    this.renderer.forceContextLoss();
  }

  private readonly draw = (millis: number): void => {
    this.asked = 0;
    if (this.isOver || this.renderer.getContext().isContextLost()) return;
    // Through a headset it is drawn by `present`; where nothing is to be seen, nothing is drawn.
    if (this.renderer.xr.isPresenting || this.host.clientWidth === 0) return;
    // One picture at a time: what is asked for meanwhile is drawn once, after it.
    if (this.pace.isBusy(this.gl)) {
      this.redraw();
      return;
    }
    const isMoved = millis - this.movedAt < STILL_MILLIS;
    this.adapt(isMoved);
    this.place();
    let isMoving = false;
    for (const prepare of this.beforeDraw) isMoving = prepare(millis) || isMoving;
    this.renderer.render(this.scene, this.camera);
    this.pace.begun(this.gl, performance.now(), this.coarseness);
    for (const follow of this.afterDraw) follow(millis);
    // What is coarse while the viewer moves is drawn once more when they rest.
    if (isMoving || (isMoved && this.coarseness > 1)) this.redraw();
  };

  private adapt(isMoved: boolean): void {
    const budget = isMoved ? BUDGET_MILLIS.moving : BUDGET_MILLIS.resting;
    const wanted = this.isPaced ? coarsenessFor(this.pace.fullMillis, budget, this.coarseness) : 1;
    if (wanted === this.coarseness) return;
    this.coarseness = wanted;
    this.renderer.setPixelRatio(devicePixelRatio / wanted);
  }

  /** From where to where something is drawn: as much of the depth's digits as possible for where the scene is. */
  private depths(): [number, number] {
    const bounds = this.surfaces?.bounds();
    if (!bounds) return [NEAR_M[0], FARTHEST_M];
    const { eye } = this.view;
    const beside = (axis: 0 | 1 | 2) => Math.max(bounds[0][axis] - eye[axis], eye[axis] - bounds[1][axis], 0);
    const across = (axis: 0 | 1 | 2) => Math.max(Math.abs(bounds[0][axis] - eye[axis]), Math.abs(bounds[1][axis] - eye[axis]));
    const nearest = Math.hypot(beside(0), beside(1), beside(2)) - ROOM_M;
    const farthest = Math.hypot(across(0), across(1), across(2)) + ROOM_M;
    return [Math.max(NEAR_M[0], nearest * NEAR_M[1]), Math.min(FARTHEST_M, Math.max(farthest, 100))];
  }

  private readonly lost = (event: Event): void => {
    // Without this the browser never gives it back.
    event.preventDefault();
    this.onHealth("lost");
  };

  private readonly restored = (): void => {
    this.onHealth("fine");
    this.redraw();
  };
}
