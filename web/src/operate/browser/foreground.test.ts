import { expect, test } from "vitest";
import { read, unrolled } from "./foreground";

function message(kind: number, count: number, body: number[]): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(40 + body.length));
  view.setUint32(0, 0x56464731);
  view.setUint8(4, kind);
  view.setUint16(6, 40);
  view.setBigInt64(8, 1_772_366_400_500_000_000n);
  view.setBigUint64(16, 7n);
  view.setUint32(24, 3);
  view.setUint16(28, 640);
  view.setUint16(30, 360);
  view.setUint32(32, count);
  view.setUint32(36, body.length);
  new Uint8Array(view.buffer).set(body, 40);
  return view.buffer;
}

test("a background is its JPEG", () => {
  const told = read(message(1, 0, [1, 2, 3]));
  expect(told).toMatchObject({ kind: "background", millis: 1_772_366_400_500, number: 7, background: 3, size: [640, 360] });
  expect(told?.kind === "background" && [...told.jpeg]).toEqual([1, 2, 3]);
});

test("a foreground is rectangles with masks and JPEGs", () => {
  const rectangle = [0, 10, 0, 20, 0, 4, 0, 2, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0, 2, 1, 4, 3, 0xff, 0xd8];
  const told = read(message(2, 1, rectangle));
  expect(told?.kind).toBe("foreground");
  if (told?.kind !== "foreground") return;
  const [first] = told.rectangles;
  expect(first).toMatchObject({ left: 10, top: 20, width: 4, height: 2, track: 9 });
  expect([...(first?.mask ?? [])]).toEqual([0, 255, 255, 255, 255, 0, 0, 0]);
  expect([...(first?.jpeg ?? [])]).toEqual([0xff, 0xd8]);
});

test("what is cut short, or something else, is no message", () => {
  const whole = message(2, 1, [0, 10]);
  expect(read(whole)).toBeNull();
  expect(read(new ArrayBuffer(8))).toBeNull();
  expect(read(new ArrayBuffer(64))).toBeNull();
  expect(read(message(9, 0, []))).toBeNull();
});

test("long runs take several bytes", () => {
  const mask = unrolled(new Uint8Array([0, 0xac, 0x02, 5]), 400);
  expect(mask.filter((pixel) => pixel === 255).length).toBe(300);
  expect(mask[299]).toBe(255);
  expect(mask[300]).toBe(0);
});
