// A scene through a headset: stereo, pointing at places to be there, turning in steps, and controllers and hands to be seen. Loaded by
// who enters it; three.js brings the rest with its renderer.

import { BufferGeometry, ConeGeometry, Float32BufferAttribute, Group, Line, LineBasicMaterial, Mesh, MeshBasicMaterial, RingGeometry, SphereGeometry, Vector3, type XRTargetRaySpace } from "three";
import type { Point, View } from "../operate/orbit";
import type { Stage } from "./stage";
import type { Picked, Surfaces } from "./surfaces";
import { type Rig, isLanding, snapped, teleported, turnedAround } from "./teleport";
import { fromThree, toThree } from "./world";

const BLUE = 0x4da3ff;
const RAY_M = 10;
const JOINT_M = 0.008;

/** What a controller is doing. */
type Hand = { readonly pointer: XRTargetRaySpace; readonly line: Line; isPointing: boolean; isTurnHeld: boolean; source: XRInputSource | null };

/** Enters the scene from where `view` looks. Resolves once the headset shows it; the answered function leaves it. Calls `onEnd` when it
 * was left, with where the viewer then stood. Throws where the headset or the viewer refuses. */
export async function enterHeadset(stage: Stage, surfaces: Surfaces, view: View, onEnd: (view: View) => void): Promise<() => Promise<void>> {
  const { xr } = navigator;
  if (!xr) throw new Error("no WebXR");
  const session = await xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor", "hand-tracking"] });
  const visit = new Visit(stage, surfaces, view);
  session.addEventListener("end", () => onEnd(visit.end()), { once: true });
  try {
    await visit.begin(session);
  } catch (error) {
    await session.end();
    throw error;
  }
  return () => session.end();
}

class Visit {
  private readonly group = new Group();
  private readonly marker = new Mesh(new RingGeometry(0.25, 0.32, 32), new MeshBasicMaterial({ color: BLUE, depthTest: false, transparent: true, opacity: 0.9 }));
  private readonly hands: Hand[];
  private rig: Rig;
  private fov: number;

  constructor(private readonly stage: Stage, private readonly surfaces: Surfaces, view: View) {
    this.fov = view.fov;
    this.rig = standingOf(view, surfaces);
    this.marker.rotation.x = -Math.PI / 2;
    this.marker.renderOrder = 3_000;
    this.marker.visible = false;
    this.hands = [0, 1].map((i) => this.hand(i));
    this.place();
  }

  async begin(session: XRSession): Promise<void> {
    const { renderer, scene, camera } = this.stage;
    scene.add(this.group, this.marker);
    // The headset moves the camera within the rig.
    camera.position.set(0, 0, 0);
    camera.quaternion.identity();
    this.group.add(camera);
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType("local-floor");
    await renderer.xr.setSession(session);
    renderer.setAnimationLoop((millis) => {
      this.move();
      this.stage.present(millis);
    });
  }

  /** Puts everything back, and answers where the viewer stood. */
  end(): View {
    const { renderer, camera } = this.stage;
    const head = this.head();
    const ahead = camera.getWorldDirection(new Vector3());
    renderer.setAnimationLoop(null);
    renderer.xr.enabled = false;
    camera.removeFromParent();
    this.group.removeFromParent();
    this.marker.removeFromParent();
    this.marker.geometry.dispose();
    this.marker.material.dispose();
    const eye = this.world(head);
    const [x, y, z] = fromThree(ahead);
    this.stage.redraw();
    return { eye, target: [eye[0] + x * RAY_M, eye[1] + y * RAY_M, eye[2] + z * RAY_M], fov: this.fov };
  }

  private hand(i: number): Hand {
    const { xr } = this.stage.renderer;
    const pointer = xr.getController(i);
    const points = new BufferGeometry().setAttribute("position", new Float32BufferAttribute([0, 0, 0, 0, 0, -1], 3));
    const line = new Line(points, new LineBasicMaterial({ color: BLUE }));
    line.scale.z = RAY_M;
    const grip = xr.getControllerGrip(i);
    const wand = new Mesh(new ConeGeometry(0.02, 0.12, 16), new MeshBasicMaterial({ color: 0xd8dee4 }));
    wand.rotation.x = -Math.PI / 2;
    const joints = xr.getHand(i);
    const made: Hand = { pointer, line, isPointing: false, isTurnHeld: false, source: null };
    pointer.add(line);
    this.group.add(pointer, grip, joints);
    pointer.addEventListener("connected", ({ data }) => {
      made.source = data;
      if (data.hand) joints.userData["isShown"] = true;
      else grip.add(wand);
    });
    pointer.addEventListener("disconnected", () => {
      made.source = null;
      wand.removeFromParent();
    });
    // Joints come one by one, as the headset finds them.
    joints.addEventListener("childadded", ({ child }: { child: { add?: (object: Mesh) => void; isMesh?: boolean } }) => {
      if (!child.isMesh) child.add?.(new Mesh(new SphereGeometry(JOINT_M, 8, 6), new MeshBasicMaterial({ color: 0xd8dee4 })));
    });
    pointer.addEventListener("selectstart", () => (made.isPointing = true));
    pointer.addEventListener("selectend", () => {
      made.isPointing = false;
      const met = this.aimed(made);
      this.marker.visible = false;
      if (met) this.go(teleported(this.rig, this.head(), this.three(met.point_m)));
    });
    return made;
  }

  private move(): void {
    this.marker.visible = false;
    for (const hand of this.hands) {
      const axes = hand.source?.gamepad?.axes ?? [];
      // Sticks are the third and fourth axis; older controllers have a touch pad as the first two.
      const { turn, isHeld } = snapped(hand.isTurnHeld, axes[2] ?? axes[0] ?? 0);
      hand.isTurnHeld = isHeld;
      if (turn !== 0) this.go(turnedAround(this.rig, this.head(), turn));
      const met = hand.isPointing ? this.aimed(hand) : null;
      hand.line.scale.z = met?.distance_m ?? RAY_M;
      if (!met) continue;
      this.marker.visible = true;
      this.marker.position.copy(this.three(met.point_m));
      this.marker.position.y += 0.02;
    }
  }

  /** Where a controller points, if one can stand there. */
  private aimed({ pointer }: Hand): Picked | null {
    pointer.updateWorldMatrix(true, false);
    const origin = new Vector3().setFromMatrixPosition(pointer.matrixWorld);
    const ahead = new Vector3(0, 0, -1).transformDirection(pointer.matrixWorld);
    const met = this.surfaces.pick({ origin: this.world(origin), direction: fromThree(ahead) });
    return met && isLanding(met.normal[2], met.distance_m) ? met : null;
  }

  private go(rig: Rig): void {
    this.rig = rig;
    this.place();
  }

  private place(): void {
    const { x, y, z, yaw } = this.rig;
    this.group.position.set(x, y, z);
    this.group.rotation.y = yaw;
    this.group.updateMatrixWorld(true);
  }

  private head(): Vector3 {
    return new Vector3().setFromMatrixPosition(this.stage.camera.matrixWorld);
  }

  private world(point: Vector3): Point {
    const [x, y, z] = fromThree(point);
    const { anchor } = this.surfaces;
    return [x + anchor[0], y + anchor[1], z + anchor[2]];
  }

  private three(point: Point): Vector3 {
    const { anchor } = this.surfaces;
    return toThree([point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]]);
  }
}

/** The play space beneath a view's eye (or, from high above, where it looks), turned the way it looks. */
export function standingOf({ eye, target }: View, surfaces: Pick<Surfaces, "pick" | "anchor">): Rig {
  const [dx, dy, dz] = [target[0] - eye[0], target[1] - eye[1], target[2] - eye[2]];
  const length = Math.hypot(dx, dy, dz) || 1;
  const below = surfaces.pick({ origin: eye, direction: [0, 0, -1] });
  const ahead = surfaces.pick({ origin: eye, direction: [dx / length, dy / length, dz / length] });
  const place = below && below.distance_m < length ? below.point_m : ahead && ahead.normal[2] > Math.SQRT1_2 ? ahead.point_m : ([target[0], target[1], 0] as const);
  const { anchor } = surfaces;
  const { x, y, z } = toThree([place[0] - anchor[0], place[1] - anchor[1], place[2] - anchor[2]]);
  // A rig that is not turned looks along -z: north.
  return { x, y, z, yaw: Math.atan2(-dx, dy) };
}
