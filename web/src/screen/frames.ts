// Pictures as they come by WebSocket: a header and the picture's file (docs/api.md, "Frames by WebSocket").

const MAGIC = "VFF1";
const LEAST_HEADER_BYTES = 48;
const TYPES: Record<number, string> = { 1: "image/jpeg", 2: "image/png" };
const NANOS = 1_000_000n;

export type Frame = {
  number: number;
  millis: number;
  version: string;
  sentMillis: number;
  rate: number;
  isLive: boolean;
  isRestricted: boolean;
  isPattern: boolean;
  blob: Blob;
};

/** What a message says and holds; nothing where it is of another kind. */
export function read(buffer: ArrayBuffer): Frame | null {
  if (buffer.byteLength < LEAST_HEADER_BYTES) return null;
  const view = new DataView(buffer);
  const magic = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  const [headerBytes, type, flags] = [view.getUint16(4), TYPES[view.getUint8(6)], view.getUint8(7)];
  if (magic !== MAGIC || type === undefined) return null;
  return {
    number: Number(view.getBigUint64(8)),
    millis: Number(view.getBigInt64(16) / NANOS),
    version: String(view.getBigInt64(24)),
    sentMillis: Number(view.getBigInt64(32) / NANOS),
    rate: view.getUint32(40) / 1e3,
    isLive: (flags & 1) !== 0,
    isRestricted: (flags & 2) !== 0,
    isPattern: (flags & 4) !== 0,
    blob: new Blob([new Uint8Array(buffer, headerBytes, view.getUint32(44))], { type }),
  };
}
