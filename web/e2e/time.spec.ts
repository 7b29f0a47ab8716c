// Going through time lands on the exact frame: a camera whose frames say their number is read back from the picture on the page,
// its own and the fused one.

import { resolve } from "node:path";
import type { APIRequestContext, Locator, Page } from "@playwright/test";
import { type Daemon, daemon } from "./daemon";
import { numberIn, writeNumbered } from "./numbered";
import { expect, forgiveBusy, fused, test } from "./page";

test.describe.configure({ mode: "serial" });
// Single frames are many requests, one after the other.
test.setTimeout(120_000);
test.use({ timezoneId: "Asia/Kolkata" });

const FOLDER = resolve(import.meta.dirname, "../../target/web-e2e-numbered");
const PICTURES = 900;
const START = Date.UTC(2026, 2, 1, 12);
const FRAME_MILLIS = 100;
const CONFIG = `
[[camera]]
id = "clock"
name = "Clock"
vision = false
source = { path = "${FOLDER}/frame%04d.png", timing = "index", rate_hz = 10, start = "2026-03-01T12:00:00Z", end = "loop" }

[[scene]]
id = "board"
file = "${FOLDER}/board.json"
`;
let own: Daemon;
/** Numbers of the frames that the daemon has: a machine that is busy leaves some out. */
let there: number[] = [];

async function framesThere(request: APIRequestContext, most: number): Promise<number[]> {
  const found = new Set<number>();
  for (let number = 0; number < most; number += 1) {
    const t = new Date(START + number * FRAME_MILLIS).toISOString();
    const { "videofields-time": time } = (await request.head(`${own.url}/api/v1/cameras/clock/frame.jpg?t=${t}`)).headers();
    // Of all that it may have, some twenty are enough.
    if (found.size > 20) break;
    if (time !== undefined) found.add(Math.round((Date.parse(time) - START) / FRAME_MILLIS));
  }
  return [...found];
}

test.beforeAll(async ({ request }) => {
  writeNumbered(FOLDER, PICTURES);
  own = await daemon("numbered", { config: CONFIG, roots: [FOLDER] });
  const known = async () => (await (await request.get(`${own.url}/api/v1/cameras/clock`)).json()) as { last: string | null; frames: number };
  await expect.poll(async () => (await known()).frames, { timeout: 60_000 }).toBeGreaterThan(20);
  there = await framesThere(request, (Date.parse((await known()).last ?? "") - START) / FRAME_MILLIS);
  expect(there.length).toBeGreaterThan(15);
});
test.afterAll(async () => {
  await own.stop();
});

forgiveBusy();

/** Types a time and goes there. */
async function type(page: Page, text: string): Promise<void> {
  const entry = page.getByRole("textbox", { name: "Date and time that is shown" });
  await entry.fill(text);
  await entry.press("Enter");
}

const timeOf = (number: number) => new Date(START + number * FRAME_MILLIS).toISOString();

/** Steps forward and back by single frames from the frame `there[first]`, where it is now. */
async function stepThrough(page: Page, image: Locator, first: number): Promise<void> {
  await expect.poll(() => numberIn(image)).toBe(there[first]);
  for (const i of [1, 2, 3, 4]) {
    await page.getByRole("button", { name: "Next frame (.)" }).click();
    await expect.poll(() => numberIn(image)).toBe(there[first + i]);
  }
  for (const i of [3, 2, 1, 0, -1]) {
    await page.keyboard.press(",");
    await expect.poll(() => numberIn(image)).toBe(there[first + i]);
  }
  // Faster than they are found, none is lost.
  for (let i = 0; i < 5; i += 1) await page.keyboard.press(".");
  await expect.poll(() => numberIn(image)).toBe(there[first + 4]);
}

test("a camera's own picture: typed times and single frames are exact", async ({ page }) => {
  await page.goto(`${own.url}/#/operate?camera=clock`);
  const image = page.locator(".alone img");
  await expect.poll(() => numberIn(image)).not.toBeNull();
  const [, , first = 0, second = 0] = there;
  await type(page, timeOf(first));
  await stepThrough(page, image, 2);
  // Without a zone it is the viewer's own, which stands beside it.
  await expect(page.getByText("UTC+05:30")).toBeVisible();
  await type(page, `2026-03-01 17:30:${timeOf(second).slice(17, 23)}`);
  await expect.poll(() => numberIn(image)).toBe(second);
  await type(page, `17:30:${timeOf(first).slice(17, 23)}`);
  await expect.poll(() => numberIn(image)).toBe(first);
  await page.reload();
  await expect.poll(() => numberIn(image)).toBe(first);
  await type(page, "yesterday");
  await expect(page.getByRole("alert").filter({ hasText: "That is no time" })).toBeVisible();
  await type(page, "2026-03-01T09:00:00Z");
  await expect(page.getByText(/Nothing is there at that time.*3 h away/)).toBeVisible();
  await expect.poll(() => numberIn(image)).toBe(there[0]);
});

test("the fused picture: the same frames, played back and forth", async ({ page }) => {
  await page.goto(`${own.url}/#/operate?at=${timeOf(there[5] ?? 0)}&map=off`);
  const stage = await fused(page);
  const image = stage.locator("img").first();
  await stepThrough(page, image, 5);
  await page.getByRole("button", { name: "Play backwards (J)" }).click();
  await expect.poll(() => numberIn(image)).toBeLessThan(there[7] ?? 0);
  await page.getByRole("button", { name: "Pause" }).click();
  await expect(page.getByRole("button", { name: "Pause" })).toHaveAttribute("aria-pressed", "true");
  await page.getByRole("button", { name: "Live", exact: true }).click();
  await expect.poll(() => numberIn(image)).toBeGreaterThan(there[14] ?? 0);
});
