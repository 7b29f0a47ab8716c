// Cameras' pictures as textures: live ones that are asked for one at a time, and still ones. Each holds one picture, the newest.

import { LinearFilter, SRGBColorSpace, Texture } from "three";
import { Trouble, ask, told } from "../ask";
import { pauser, seen } from "../pause";

/** What a camera shows: its newest frame, or the place without what moves. */
export type What = "frame" | "background";

/** Larger pictures are made smaller before they reach the graphics card. */
const MOST_PIXELS = 2_048;
const AFTER_TROUBLE_MILLIS = 2_000;

/** A picture that may change. */
export class CameraTexture {
  /** Its rows from above; null until there is a picture. */
  texture: Texture | null = null;
  size: readonly [number, number] = [0, 0];
  /** One more with every picture. */
  version = 0;
  /** Why there is none, or none newer; null while all is well. */
  trouble: string | null = null;
  /** The time that the picture shows, milliseconds since 1970, where the daemon told it. */
  millis: number | null = null;
  protected isOver = false;

  constructor(private readonly onChange: () => void = () => {}) {}

  /** Shows this picture from now on. Bitmaps are let go of when the next one comes. */
  set(image: ImageBitmap | HTMLCanvasElement | OffscreenCanvas | HTMLVideoElement): void {
    if (this.isOver) {
      if (image instanceof ImageBitmap) image.close();
      return;
    }
    const size = image instanceof HTMLVideoElement ? [image.videoWidth, image.videoHeight] as const : [image.width, image.height] as const;
    const isFitting = this.texture !== null && size[0] === this.size[0] && size[1] === this.size[1];
    const before: unknown = this.texture?.image;
    if (!isFitting || !this.texture) {
      this.texture?.dispose();
      this.texture = new Texture();
      this.texture.colorSpace = SRGBColorSpace;
      this.texture.flipY = false;
      this.texture.generateMipmaps = false;
      [this.texture.minFilter, this.texture.magFilter] = [LinearFilter, LinearFilter];
    }
    this.texture.image = image;
    this.texture.needsUpdate = true;
    this.size = size;
    this.version += 1;
    this.trouble = null;
    if (before instanceof ImageBitmap && before !== image) before.close();
    this.onChange();
  }

  fail(message: string): void {
    this.trouble = message;
    this.onChange();
  }

  dispose(): void {
    this.isOver = true;
    const image: unknown = this.texture?.image;
    this.texture?.dispose();
    this.texture = null;
    if (image instanceof ImageBitmap) image.close();
  }
}

/** The picture of a file, no larger than is drawn. */
export async function decoded(file: Blob): Promise<ImageBitmap> {
  const image = await createImageBitmap(file, { colorSpaceConversion: "none" });
  const most = Math.max(image.width, image.height);
  if (most <= MOST_PIXELS) return image;
  const share = MOST_PIXELS / most;
  const smaller = await createImageBitmap(image, {
    resizeWidth: Math.round(image.width * share),
    resizeHeight: Math.round(image.height * share),
    resizeQuality: "high",
  });
  image.close();
  return smaller;
}

/** A picture that stays: of a file, or what was drawn. */
export function stillTexture(picture: Blob | ImageBitmap | HTMLCanvasElement, onChange?: () => void): CameraTexture {
  const shown = new CameraTexture(onChange);
  if (picture instanceof Blob) void decoded(picture).then((image) => shown.set(image), (error: unknown) => shown.fail(told(error)));
  else shown.set(picture);
  return shown;
}

export type LiveOptions = {
  what?: What;
  everyMillis?: number;
  /** A time of the past, milliseconds since 1970: asked for once. */
  at?: number | null;
  onChange?: () => void;
};

/** A camera's picture, asked for again and again while the page is seen; `end` stops that and lets go of it. */
export class LiveTexture extends CameraTexture {
  private readonly ending = new AbortController();
  private readonly rest = pauser();
  private what: What;
  private at: number | null;
  private everyMillis: number;

  constructor(readonly camera: string, { what = "frame", everyMillis = 500, at = null, onChange }: LiveOptions = {}) {
    super(onChange);
    [this.what, this.at, this.everyMillis] = [what, at, everyMillis];
    void this.run();
  }

  /** Shows something else of the camera from now on. */
  want({ what = this.what, at = this.at, everyMillis = this.everyMillis }: Omit<LiveOptions, "onChange">): void {
    if (what === this.what && at === this.at && everyMillis === this.everyMillis) return;
    [this.what, this.at, this.everyMillis] = [what, at, everyMillis];
    this.rest.wake();
  }

  override dispose(): void {
    this.ending.abort();
    this.rest.wake();
    super.dispose();
  }

  private async run(): Promise<void> {
    let tag: string | null = null;
    let last = "";
    while (!this.ending.signal.aborted) {
      await seen();
      const start = performance.now();
      const [what, at] = [this.what, this.at];
      const wish = `${what} ${at ?? "now"}`;
      let pause = at === null ? this.everyMillis : Infinity;
      try {
        const t = at === null ? {} : { t: new Date(at).toISOString() };
        const path = `/api/v1/cameras/${encodeURIComponent(this.camera)}/${what}.jpg`;
        const response = await ask(path, t, { signal: this.ending.signal, tag: wish === last ? tag : null });
        // What was wished for meanwhile is another picture: this one is old.
        if (response.status !== 304 && what === this.what && at === this.at) {
          const image = await decoded(await response.blob());
          const millis = Date.parse(response.headers.get("Videofields-Time") ?? "");
          this.millis = Number.isFinite(millis) ? millis : null;
          this.set(image);
          [tag, last] = [response.headers.get("ETag"), wish];
        }
      } catch (error) {
        if (this.isOver) return;
        this.fail(error instanceof Trouble ? told(error) : String(error));
        pause = AFTER_TROUBLE_MILLIS;
      }
      // A timer takes no endless pause.
      await this.rest.pause(Math.min(2 ** 31 - 1, Math.max(0, pause - (performance.now() - start))));
    }
  }
}

/** A camera's picture as it changes. */
export function liveTexture(camera: string, options?: LiveOptions): LiveTexture {
  return new LiveTexture(camera, options);
}
