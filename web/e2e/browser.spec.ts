// The fused view as the browser draws it: that its picture is the daemon's, that people are in it, who draws and why, and how fast.

import { note } from "./figures";
import { expect, test } from "./page";
import { type Point, type View, placed } from "../src/operate/orbit";
import type { Page } from "@playwright/test";

const VIEW: View = { eye: [-6, -19, 7], target: [0.5, 1, 0.5], fov: 45 };
const SEEN = "eye=-6,-19,7&target=0.5,1,0.5&fov=45&labels=off&trails=off&map=off";
/** Corners of the hall and of the café, and places of the paving with something on it. */
const PLACES: Point[] = [
  [-1, 6.5, 0], [-1, 6.5, 6.4], [-6, 6.5, 0], [8.7, -0.27, 0], [8.7, -0.27, 4], [7.21, 4.29, 0],
  [0, 0, 0], [3.2, 0, 0], [-3.2, 0, 0], [0, 3.2, 0],
];
/** Half a side of what is compared, and how far off it is looked for, pixels. */
const PATCH = 14;
const REACH = 5;

type Compared = { mean: number; shifts: { x: number; y: number }[] };

/** What the canvas shows. It can be read only in the frame in which it was drawn, so until one is met; the page may lie between two
 * pixels, so that a picture of the page would not do. */
async function canvasOf(page: Page): Promise<{ png: Buffer; width: number; height: number }> {
  const { text, width, height } = await page.locator(".drawn-here canvas").evaluate((canvas: HTMLCanvasElement) => new Promise<{ text: string; width: number; height: number }>((resolve) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d");
    const look = () => {
      context?.drawImage(canvas, 0, 0);
      const isDrawn = (context?.getImageData(copy.width >> 1, copy.height >> 1, 1, 1).data[3] ?? 0) > 0;
      if (isDrawn) resolve({ text: copy.toDataURL(), width: copy.width, height: copy.height });
      else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  }));
  return { png: Buffer.from(text.split(",")[1] ?? "", "base64"), width, height };
}

/** How far off patches of one picture are in another: where they differ least. */
function compared(page: Page, mine: Buffer, theirs: Buffer, spots: number[][]): Promise<Compared> {
  return page.evaluate(async ({ files, spots, patch, reach }) => {
    const [a, b] = await Promise.all(files.map(async (text) => {
      const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes]));
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext("2d");
      context?.drawImage(image, 0, 0);
      const { data, width, height } = context?.getImageData(0, 0, image.width, image.height) ?? new ImageData(1, 1);
      return { width, height, at: (x: number, y: number) => [0, 1, 2].map((channel) => data[(y * width + x) * 4 + channel] ?? 0) };
    }));
    if (!a || !b) return { mean: NaN, shifts: [] };
    const apart = (x: number, y: number, dx: number, dy: number) => {
      const [one, other] = [b.at(x, y), a.at(x + dx, y + dy)];
      return one.reduce((sum, code, channel) => sum + Math.abs(code - (other[channel] ?? 0)), 0) / 3;
    };
    const around = (x: number, y: number, dx: number, dy: number) => {
      let sum = 0;
      for (let row = -patch; row <= patch; row += 1) for (let column = -patch; column <= patch; column += 1) sum += apart(x + column, y + row, dx, dy) ** 2;
      return sum;
    };
    const shifts = spots.map(([x = 0, y = 0]) => {
      let best = { x: 0, y: 0, sum: Infinity };
      for (let dy = -reach; dy <= reach; dy += 1) {
        for (let dx = -reach; dx <= reach; dx += 1) {
          const sum = around(x, y, dx, dy);
          if (sum < best.sum) best = { x: dx, y: dy, sum };
        }
      }
      return { x: best.x, y: best.y };
    });
    let [total, count] = [0, 0];
    for (let y = 4; y < b.height - 4; y += 3) for (let x = 4; x < b.width - 4; x += 3) [total, count] = [total + apart(x, y, 0, 0), count + 1];
    return { mean: total / count, shifts };
  }, { files: [mine, theirs].map((bytes) => bytes.toString("base64")), spots, patch: PATCH, reach: REACH });
}

test("the browser's picture is the daemon's, within two pixels", async ({ page, url, request }) => {
  await page.goto(`${url}/#/operate?drawing=browser&entities=none&quality=exact&${SEEN}`);
  await expect(page.locator(".drawn-here")).toHaveAttribute("data-cameras", "3");
  await expect(page.getByRole("application")).toHaveAttribute("data-time", /\d+/);
  const { png, width, height } = await canvasOf(page);
  const spots = PLACES.flatMap((place) => {
    const at = placed(VIEW, width / height, place);
    return at ? [[Math.round(at[0] * width), Math.round(at[1] * height)]] : [];
  }).filter(([x = 0, y = 0]) => x > 24 && y > 24 && x < width - 24 && y < height - 24);
  expect(spots.length).toBeGreaterThanOrEqual(8);
  const asked = new URLSearchParams(`${SEEN.split("&labels")[0]}&entities=none&quality=exact&colors=raw&see_through=off`);
  asked.set("width", String(width));
  asked.set("height", String(height));
  let theirs: Buffer = Buffer.alloc(0);
  await expect(async () => {
    const answer = await request.get(`${url}/api/v1/scenes/plaza/view.png?${asked}`);
    expect(answer.status()).toBe(200);
    theirs = await answer.body();
  }).toPass();
  const result = await compared(page, png, theirs, spots);
  for (const { x, y } of result.shifts) expect(Math.hypot(x, y)).toBeLessThanOrEqual(2);
  expect(result.mean).toBeLessThan(5);
  note("browser_apart_codes", result.mean);
  note("browser_apart_px", Math.max(...result.shifts.map(({ x, y }) => Math.hypot(x, y))));
});

test("people are in it, and how fast it is gets measured", async ({ page, url }) => {
  await page.goto(`${url}/#/operate?drawing=browser&${SEEN}`);
  const here = page.locator(".drawn-here");
  await expect(here).toHaveAttribute("data-cameras", "3");
  await expect(here).toHaveAttribute("data-people", /[1-9]/);
  await expect(here).toHaveAttribute("data-measured", /\d/);
  const rate = Number(await here.getAttribute("data-measured"));
  expect(rate).toBeGreaterThan(0);
  note("browser_fps", rate);
  note("browser_fps_width_px", await here.locator("canvas").evaluate((canvas: HTMLCanvasElement) => canvas.width));
  // The past is the daemon's to draw, and coming back is the browser's again.
  await page.getByRole("button", { name: /^Frame before/ }).click();
  await expect(page.locator("[data-drawn-by]")).toHaveAttribute("data-why", "past");
  await expect(page.getByRole("application").locator("img:not(.is-empty)")).toHaveCount(1);
  await page.getByRole("button", { name: "Live", exact: true }).click();
  await expect(here).toHaveAttribute("data-cameras", "3");
});

test("buildings that hide somebody are seen through, as long as that is wanted", async ({ page, url }) => {
  test.setTimeout(90_000);
  // From behind the hall, where the daemon opens it too.
  await page.goto(`${url}/#/operate?eye=-4,15,3&target=-2,0,1&fov=50&drawing=browser&map=off`);
  const drawn = page.locator(".drawn-here");
  await expect(drawn).toHaveAttribute("data-opened", /[1-9]/, { timeout: 40_000 });
  const asked = await page.request.get(`${url}/api/v1/scenes/plaza/plan?eye=-4,15,3&target=-2,0,1&fov=50&width=320&height=180`);
  expect(((await asked.json()) as { opened: { surface: string }[] }).opened.map(({ surface }) => surface)).toContain("box");
  await page.getByText("Picture", { exact: true }).first().click();
  await page.getByLabel("See through buildings").uncheck();
  await expect(drawn).toHaveAttribute("data-opened", "0");
});

test("without a graphics card the daemon draws, and says why", async ({ page, url }) => {
  await page.goto(url);
  await expect(page.locator("[data-drawn-by]")).toHaveAttribute("data-drawn-by", "server");
  await expect(page.locator("[data-drawn-by]")).toHaveAttribute("data-why", "software");
  await expect(page.locator(".drawn-here")).toHaveCount(0);
});
