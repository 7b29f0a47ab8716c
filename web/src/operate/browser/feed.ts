// A camera's foreground as it comes: its background as a texture, and what moves in the newest frame, with its colours decoded. What
// comes while a frame is being decoded is left out but for the newest.

import { CameraTexture, decoded } from "../../spatial/cameraTextures";
import { type Message, type Rectangle, read } from "./foreground";

/** What moves in one frame. */
export type Frame = {
  readonly millis: number;
  readonly size: readonly [number, number];
  readonly things: readonly { readonly rectangle: Rectangle; readonly image: ImageBitmap }[];
};

/** Pauses before it is asked for again, milliseconds: longer each time, up to the last. */
const AGAIN_MILLIS = [500, 1_000, 2_000, 5_000] as const;
/** The daemon's word that the caller may not, or that there is no such camera. */
const REFUSED = [1008, 4404];

export class Feed {
  readonly background: CameraTexture;
  frame: Frame | null = null;
  /** When something last came, of `performance.now()`; 0 until it did. */
  heardAt = 0;
  private socket: WebSocket | null = null;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private failures = 0;
  private waiting: Message | null = null;
  private isDecoding = false;
  private isOver = false;

  constructor(readonly camera: string, private readonly onChange: () => void) {
    this.background = new CameraTexture(onChange);
    this.open();
  }

  dispose(): void {
    this.isOver = true;
    clearTimeout(this.timer);
    this.socket?.close();
    this.letGo(this.frame);
    this.frame = null;
    this.background.dispose();
  }

  private open(): void {
    const address = new URL(`/api/v1/cameras/${encodeURIComponent(this.camera)}/foreground`, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.addEventListener("message", ({ data }: MessageEvent<unknown>) => {
      const message = data instanceof ArrayBuffer ? read(data) : null;
      if (!message) return;
      this.heardAt = performance.now();
      this.failures = 0;
      if (message.kind === "background") void this.takeBackground(message.jpeg);
      else this.take(message);
    });
    socket.addEventListener("close", ({ code }) => {
      if (this.isOver || REFUSED.includes(code)) return;
      const pause = AGAIN_MILLIS[Math.min(this.failures, AGAIN_MILLIS.length - 1)] ?? 0;
      this.failures += 1;
      this.timer = setTimeout(() => this.open(), pause);
    });
  }

  private async takeBackground(jpeg: Uint8Array<ArrayBuffer>): Promise<void> {
    const image = await decoded(new Blob([jpeg], { type: "image/jpeg" })).catch(() => null);
    if (image) this.background.set(image);
  }

  private take(message: Message): void {
    this.waiting = message;
    if (!this.isDecoding) void this.decode();
  }

  private async decode(): Promise<void> {
    this.isDecoding = true;
    for (let message = this.waiting; message && !this.isOver; message = this.waiting) {
      this.waiting = null;
      if (message.kind !== "foreground") continue;
      const things = await Promise.all(message.rectangles.map(async (rectangle) => {
        const file = new Blob([rectangle.jpeg], { type: "image/jpeg" });
        const image = await createImageBitmap(file, { colorSpaceConversion: "none" }).catch(() => null);
        return image && { rectangle, image };
      }));
      const next = { millis: message.millis, size: message.size, things: things.filter((thing) => thing !== null) };
      // The loop's own test of it was before the pictures were decoded.
      if (this.hasEnded()) this.letGo(next);
      else {
        this.letGo(this.frame);
        this.frame = next;
        this.onChange();
      }
    }
    this.isDecoding = false;
  }

  private hasEnded(): boolean {
    return this.isOver;
  }

  private letGo(frame: Frame | null): void {
    for (const { image } of frame?.things ?? []) image.close();
  }
}
