// A camera whose frames say their number: pictures with a bar code of black and white blocks, and the reading of it from whatever
// picture of a page shows them, the camera's own or one from straight above.

import { mkdirSync, rmSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { crc32, deflateSync } from "node:zlib";
import type { Locator } from "@playwright/test";

const [WIDTH, HEIGHT] = [320, 180] as const;
export const BITS = 10;
/** What the camera sees from ten metres above, metres. */
const [ACROSS_M, DOWN_M] = [10, 5.625] as const;
const BLOCK_M = 0.8;
const GREY = 110;

/** Where a bit lies, metres from the middle. */
const middleOf = (bit: number) => (bit - (BITS - 1) / 2) * BLOCK_M;

function chunk(kind: string, data: Buffer): Buffer {
  const body = Buffer.concat([Buffer.from(kind, "latin1"), data]);
  const around = Buffer.alloc(8);
  around.writeUInt32BE(data.length, 0);
  around.writeUInt32BE(crc32(body), 4);
  return Buffer.concat([around.subarray(0, 4), body, around.subarray(4)]);
}

/** The code above, and beneath it the same in black for white, so that a reader knows that it has read a code. */
function png(number: number): Buffer {
  const rows = Buffer.alloc((WIDTH + 1) * HEIGHT, GREY);
  for (let y = 0; y < HEIGHT; y += 1) {
    rows[y * (WIDTH + 1)] = 0;
    const down = ((y + 0.5) / HEIGHT - 0.5) * DOWN_M;
    if (Math.abs(down) > 1.4) continue;
    for (let x = 0; x < WIDTH; x += 1) {
      const bit = Math.round((((x + 0.5) / WIDTH - 0.5) * ACROSS_M) / BLOCK_M + (BITS - 1) / 2);
      if (bit < 0 || bit >= BITS) continue;
      const isSet = ((number >> bit) & 1) === 1;
      rows[y * (WIDTH + 1) + 1 + x] = isSet === down < 0 ? 240 : 15;
    }
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(WIDTH, 0);
  header.writeUInt32BE(HEIGHT, 4);
  header.set([8, 0, 0, 0, 0], 8);
  const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([signature, chunk("IHDR", header), chunk("IDAT", deflateSync(rows, { level: 1 })), chunk("IEND", Buffer.alloc(0))]);
}

/** Writes `count` numbered pictures into a folder, and a scene that the camera `clock` sees from above. */
export function writeNumbered(folder: string, count: number): void {
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder, { recursive: true });
  for (let number = 0; number < count; number += 1) writeFileSync(resolve(folder, `frame${String(number).padStart(4, "0")}.png`), png(number));
  const focal = (WIDTH / ACROSS_M) * 10;
  const calibration = { image_size_px: [WIDTH, HEIGHT], focal_px: [focal, focal], center_px: [WIDTH / 2, HEIGHT / 2], position_m: [0, 0, 10], world_from_camera: [1, 0, 0, 0] };
  const ground = [{ polygon: [[-5, -2.8], [5, -2.8], [5, 2.8], [-5, 2.8]] }];
  const view = { eye_m: [0, -0.02, 10], target_m: [0, 0, 0], fov_deg: ABOVE_FOV };
  writeFileSync(resolve(folder, "board.json"), JSON.stringify({ version: 1, name: "Board", ground, cameras: [{ id: "clock", calibration }], view }));
}

/** The vertical angle at which a view from where the camera is shows as much as it, degrees. */
const ABOVE_FOV = (2 * Math.atan(DOWN_M / 2 / 10) * 180) / Math.PI;

/** The number in the picture that is shown; null while it shows none. */
export async function numberIn(image: Locator): Promise<number | null> {
  const given = { bits: BITS, middles: Array.from({ length: BITS }, (_, bit) => middleOf(bit)), down: DOWN_M };
  return image.evaluate((element: HTMLImageElement, { bits, middles, down }) => {
    const [width, height] = [element.naturalWidth, element.naturalHeight];
    if (width === 0) return null;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d");
    context?.drawImage(element, 0, 0);
    const scale = height / down;
    const at = (x: number, y: number) => context?.getImageData(Math.round(width / 2 + x * scale), Math.round(height / 2 + y * scale), 1, 1).data[1] ?? 0;
    let number = 0;
    for (let bit = 0; bit < bits; bit += 1) {
      const [above, below] = [at(middles[bit] ?? 0, -0.7), at(middles[bit] ?? 0, 0.7)];
      if (Math.abs(above - below) < 90) return null;
      if (above > below) number += 2 ** bit;
    }
    return number;
  }, given);
}
