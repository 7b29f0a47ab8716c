// A message's header is read as docs/api.md has it.

import { expect, test } from "vitest";
import { read } from "./frames";

function message(): ArrayBuffer {
  const buffer = new ArrayBuffer(51);
  const view = new DataView(buffer);
  new Uint8Array(buffer).set(new TextEncoder().encode("VFF1"));
  view.setUint16(4, 48);
  view.setUint8(6, 1);
  view.setUint8(7, 3);
  view.setBigUint64(8, 17n);
  view.setBigInt64(16, 1_772_366_400_500_000_000n);
  view.setBigInt64(24, 4n);
  view.setBigInt64(32, 1_772_366_400_600_000_000n);
  view.setUint32(40, 10_000);
  view.setUint32(44, 3);
  return buffer;
}

test("a frame is read", async () => {
  const { blob, ...told } = read(message()) ?? { blob: null };
  expect(told).toEqual({
    number: 17, millis: 1_772_366_400_500, version: "4", sentMillis: 1_772_366_400_600, rate: 10, isLive: true, isRestricted: true, isPattern: false,
  });
  expect([blob?.type, blob?.size]).toEqual(["image/jpeg", 3]);
  expect(new Uint8Array((await blob?.arrayBuffer()) ?? new ArrayBuffer(0))).toEqual(new Uint8Array(3));
});

test("what is no frame is none", () => {
  expect(read(new ArrayBuffer(8))).toBeNull();
  expect(read(new ArrayBuffer(64))).toBeNull();
});
