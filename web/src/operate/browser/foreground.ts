// Messages of a camera's foreground (docs/api.md, "Foreground by WebSocket"): a background, then for each frame what moves before it.

/** A rectangle in which something moves: its place in the picture, the number of the track that it shows (0 of none), which of its
 * pixels move (255, row after row), and its colours as a JPEG. */
export type Rectangle = {
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
  readonly track: number;
  readonly mask: Uint8Array;
  readonly jpeg: Uint8Array<ArrayBuffer>;
};

export type Message = {
  readonly millis: number;
  readonly number: number;
  readonly background: number;
  readonly size: readonly [number, number];
} & ({ readonly kind: "background"; readonly jpeg: Uint8Array<ArrayBuffer> } | { readonly kind: "foreground"; readonly rectangles: readonly Rectangle[] });

const MAGIC = 0x56_46_47_31;
const LEAST_HEADER = 40;
const RECTANGLE = 24;
const MOVING = 255;

/** What a message says; null of what is no such message. */
export function read(bytes: ArrayBuffer): Message | null {
  if (bytes.byteLength < LEAST_HEADER) return null;
  const view = new DataView(bytes);
  const header = view.getUint16(6);
  if (view.getUint32(0) !== MAGIC || header < LEAST_HEADER || header > bytes.byteLength) return null;
  const length = view.getUint32(36);
  if (header + length > bytes.byteLength) return null;
  const common = {
    millis: Number(view.getBigInt64(8) / 1_000n) / 1e3,
    number: Number(view.getBigUint64(16)),
    background: view.getUint32(24),
    size: [view.getUint16(28), view.getUint16(30)] as const,
  };
  const kind = view.getUint8(4);
  if (kind === 1) return { ...common, kind: "background", jpeg: new Uint8Array(bytes, header, length) };
  if (kind !== 2) return null;
  const rectangles = readRectangles(bytes, header, header + length, view.getUint32(32));
  return rectangles && { ...common, kind: "foreground", rectangles };
}

function readRectangles(bytes: ArrayBuffer, from: number, end: number, count: number): Rectangle[] | null {
  const view = new DataView(bytes);
  const rectangles: Rectangle[] = [];
  let at = from;
  for (let i = 0; i < count; i += 1) {
    if (at + RECTANGLE > end) return null;
    const [left, top, width, height] = [view.getUint16(at), view.getUint16(at + 2), view.getUint16(at + 4), view.getUint16(at + 6)];
    const [maskLength, jpegLength] = [view.getUint32(at + 16), view.getUint32(at + 20)];
    const track = Number(view.getBigUint64(at + 8));
    const [maskAt, jpegAt] = [at + RECTANGLE, at + RECTANGLE + maskLength];
    at = jpegAt + jpegLength;
    if (at > end) return null;
    const mask = unrolled(new Uint8Array(bytes, maskAt, maskLength), width * height);
    rectangles.push({ left, top, width, height, track, mask, jpeg: new Uint8Array(bytes, jpegAt, jpegLength) });
  }
  return rectangles;
}

/** A mask of so many pixels, from run lengths in LEB128: of background, of what moves, of background, and so on. */
export function unrolled(runs: Uint8Array, count: number): Uint8Array {
  const mask = new Uint8Array(count);
  let [at, pixel, isMoving] = [0, 0, false];
  while (at < runs.length && pixel < count) {
    let [length, shift] = [0, 0];
    for (;;) {
      const byte = runs[at] ?? 0;
      at += 1;
      length += (byte & 0x7f) * 2 ** shift;
      shift += 7;
      if (byte < 0x80 || at >= runs.length || shift > 42) break;
    }
    const end = Math.min(count, pixel + length);
    if (isMoving) mask.fill(MOVING, pixel, end);
    [pixel, isMoving] = [end, !isMoving];
  }
  return mask;
}
