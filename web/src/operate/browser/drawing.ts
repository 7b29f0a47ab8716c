// The fused scene of now, drawn by this browser: surfaces with the cameras' backgrounds on them, and what moves before each camera as
// upright rectangles. Knows no signals and no component: whoever owns it tells it what to show.

import type { SceneDocument } from "../../spatial/surfaces";
import { type Lens, lensOf } from "../../spatial/lens";
import { Projection } from "../../spatial/projection";
import { type Health, Stage } from "../../spatial/stage";
import { type Surfaces, surfacesOf } from "../../spatial/surfaces";
import type { Point, View } from "../orbit";
import { type Known, type Memory, type Seen, chosen, memory } from "./crowd";
import { Feed, type Frame } from "./feed";
import { type Gains, NO_GAINS } from "./gains";
import { type Hiding, Openings, hidingOf } from "./seeThrough";
import { type Sprite, Sprites } from "./sprites";
import { type Upright, uprightOf } from "./upright";

/** What was drawn: from when, by camera, and how fast. */
export type Drawn = {
  readonly frames: ReadonlyMap<string, number>;
  readonly rate: number;
  readonly people: number;
  /** Whose backgrounds are on the surfaces. */
  readonly cameras: readonly string[];
  /** Buildings that are seen through. */
  readonly opened: number;
};

type Thing = Frame["things"][number];
type Sight = Seen & { readonly thing: Thing; readonly lens: Lens; readonly size: readonly [number, number] };

/** Things of the newest frame that are older than this are not there any more, milliseconds. */
const STALE_MILLIS = 3_000;

/** What lies no farther above or below a foot is what it stands on, metres. */
const STEP_M = 0.1;

/** What people stand on, which is ground as well. */
function stoodUpon(standing: readonly Sprite[], surfaces: Surfaces): Set<string> {
  return new Set(standing.flatMap(({ place: [x, y, z] }) => {
    const below = surfaces.pick({ origin: [x, y, z + STEP_M], direction: [0, 0, -1] });
    return below && below.distance_m <= 2 * STEP_M ? [below.key] : [];
  }));
}

export class Drawing {
  readonly stage: Stage;
  surfaces: Surfaces | null = null;
  private projection: Projection | null = null;
  private readonly sprites = new Sprites();
  private readonly feeds = new Map<string, Feed>();
  private lenses = new Map<string, Lens>();
  private known: readonly Known[] = [];
  private knownAt = NaN;
  private readonly remembered: Memory = memory();
  /** Where what moves in a frame stands, worked out once. */
  private readonly uprights = new WeakMap<Thing, { version: number; upright: Upright | null }>();
  private hasEntities = true;
  private isSeenThrough = true;
  private readonly openings = new Openings();
  private gains = NO_GAINS;
  private isProjectionStale = true;
  private document: SceneDocument | null = null;

  constructor(host: HTMLElement, onHealth: (health: Health) => void, private readonly onDrawn: (drawn: Drawn) => void) {
    this.stage = new Stage(host, onHealth);
    this.stage.isPaced = true;
    this.stage.world.add(this.sprites.group);
    this.stage.beforeDraw.add(this.prepare);
    this.stage.afterDraw.add(this.tell);
  }

  /** Shows this scene, as those of its cameras see it that `camera` names. */
  show(document: SceneDocument, cameras: readonly string[]): void {
    if (document !== this.document) {
      this.document = document;
      if (this.surfaces) this.surfaces.update(document);
      else {
        this.surfaces = surfacesOf(document, { onChange: this.stage.redraw });
        this.projection = new Projection(this.surfaces);
        this.projection.attach(this.stage);
        this.stage.show(this.surfaces);
      }
      this.lenses = new Map((document.cameras ?? []).flatMap(({ id, calibration }) => ("import" in calibration ? [] : [[id, lensOf(calibration)]])));
    }
    for (const [id, feed] of this.feeds) {
      if (cameras.includes(id) && this.lenses.has(id)) continue;
      feed.dispose();
      this.feeds.delete(id);
    }
    for (const id of cameras) if (this.lenses.has(id) && !this.feeds.has(id)) this.feeds.set(id, new Feed(id, this.came));
    this.came();
  }

  look(view: View): void {
    this.stage.look(view);
  }

  /** Whether people and things are shown. */
  setEntities(areShown: boolean): void {
    this.hasEntities = areShown;
    this.stage.redraw();
  }

  /** Whether buildings let through whom they hide. */
  setSeeThrough(isOn: boolean): void {
    this.isSeenThrough = isOn;
    this.stage.redraw();
  }

  /** What cameras' colours are multiplied by. */
  setGains(gains: Gains): void {
    this.gains = gains;
    this.came();
  }

  /** What the daemon knows of who is where. */
  setKnown(known: readonly Known[], at: number): void {
    [this.known, this.knownAt] = [known, at];
    this.stage.redraw();
  }

  /** Cameras that nothing came from for so long, or ever. */
  silent(millis: number): string[] {
    return [...this.feeds].filter(([, { heardAt }]) => performance.now() - heardAt > millis).map(([id]) => id);
  }

  /** When something last came from any camera, of `performance.now()`. */
  get heardAt(): number {
    return Math.max(0, ...[...this.feeds.values()].map(({ heardAt }) => heardAt));
  }

  dispose(): void {
    for (const feed of this.feeds.values()) feed.dispose();
    this.projection?.dispose();
    this.sprites.dispose();
    this.surfaces?.dispose();
    this.stage.dispose();
  }

  private readonly came = (): void => {
    this.isProjectionStale = true;
    this.stage.redraw();
  };

  private readonly prepare = (millis: number): boolean => {
    if (this.isProjectionStale) {
      this.isProjectionStale = false;
      this.projection?.set([...this.feeds].flatMap(([id, { background }]) => {
        const lens = this.lenses.get(id);
        return lens && background.texture ? [{ id, lens, picture: background, gain: this.gainOf(id) }] : [];
      }));
    }
    const { eye } = this.stage;
    const standing = this.hasEntities ? this.standing(eye) : [];
    this.sprites.show(standing, this.stage.anchor);
    this.sprites.face(eye);
    return this.open(standing, eye, millis);
  };

  /** Opens what hides somebody; true while that still moves. */
  private open(standing: readonly Sprite[], eye: Point, millis: number): boolean {
    const { surfaces } = this;
    if (!surfaces) return false;
    const hiding: Hiding = this.isSeenThrough ? hidingOf(standing, eye, (ray, reach) => surfaces.crossed(ray, reach), stoodUpon(standing, surfaces)) : new Map();
    const isMoving = this.openings.step(hiding, millis);
    surfaces.fade(this.openings.opacities);
    this.sprites.order(new Set([...hiding.values()].flatMap(({ hides }) => [...hides])));
    return isMoving;
  }

  private gainOf(camera: string): Point {
    return this.gains.get(camera) ?? [1, 1, 1];
  }

  private standing(eye: Point): Sprite[] {
    const sights = [...this.feeds].flatMap(([camera, feed]) => this.sightsOf(camera, feed));
    return chosen(sights, this.known, this.knownAt, eye, this.remembered)
      .map(({ seen: { camera, upright, lens, size, thing }, place }) => (
        { upright, place, lens, gain: this.gainOf(camera), size, rectangle: thing.rectangle, image: thing.image }));
  }

  private sightsOf(camera: string, { frame, heardAt }: Feed): Sight[] {
    const lens = this.lenses.get(camera);
    const { surfaces } = this;
    if (!lens || !surfaces || !frame || performance.now() - heardAt > STALE_MILLIS) return [];
    return frame.things.flatMap((thing): Sight[] => {
      let kept = this.uprights.get(thing);
      if (kept?.version !== surfaces.version) {
        kept = { version: surfaces.version, upright: uprightOf(lens, frame.size, thing.rectangle, (ray) => surfaces.pick(ray)) };
        this.uprights.set(thing, kept);
      }
      const { upright } = kept;
      return upright ? [{ camera, track: thing.rectangle.track, millis: frame.millis, eye: lens.position, upright, thing, lens, size: frame.size }] : [];
    });
  }

  private readonly tell = (): void => {
    const frames = new Map([...this.feeds].flatMap(([id, { frame }]) => (frame ? [[id, frame.millis] as const] : [])));
    this.onDrawn({ frames, rate: this.stage.pace.rate(), people: this.sprites.count, cameras: this.projection?.cameras ?? [], opened: this.openings.opacities.size });
  };
}
