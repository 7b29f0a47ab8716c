// Pictures as they come by WebSocket: a header and the picture's file (docs/api.md, "Frames by WebSocket").

const [MAGIC, LEAST_HEADER_BYTES] = ["VFF1", 48];
const TYPES = { 1: "image/jpeg", 2: "image/png" };
const NANOS = 1_000_000n;

/** What a message says and holds; nothing where it is of another kind. */
function read(buffer) {
  if (buffer.byteLength < LEAST_HEADER_BYTES) return null;
  const view = new DataView(buffer);
  const magic = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  const [headerBytes, type, flags] = [view.getUint16(4), TYPES[view.getUint8(6)], view.getUint8(7)];
  if (magic !== MAGIC || !type) return null;
  return {
    number: Number(view.getBigUint64(8)),
    millis: Number(view.getBigInt64(16) / NANOS),
    version: String(view.getBigInt64(24)),
    sentMillis: Number(view.getBigInt64(32) / NANOS),
    rate: view.getUint32(40) / 1e3,
    isLive: (flags & 1) !== 0,
    isRestricted: (flags & 2) !== 0,
    blob: new Blob([new Uint8Array(buffer, headerBytes, view.getUint32(44))], { type }),
  };
}

export const frames = { read };
