// A wall is laid out by the page's editor, and its screens stay in one frame.

import type { BrowserContext, Locator, Page } from "@playwright/test";
import { expect, test } from "./page";

const TILES = ["r1c1", "r1c2", "r1c3", "r2c1", "r2c2", "r2c3"];
// One processor may have to draw six screens and the daemon's pictures: slow enough for it to be idle between frames.
const FRAME_MILLIS = 1000;
const SAMPLES = 8;
const SETTLED_FRAMES = 5;

async function fill(page: Page, group: string, values: readonly number[]): Promise<void> {
  const fields = page.getByRole("group", { name: group }).getByRole("spinbutton");
  for (const [i, value] of values.entries()) await fields.nth(i).fill(String(value));
}

/** Sets a field without leaving it to chance which of a name is meant. */
const field = (page: Page, name: string): Locator => page.getByRole("spinbutton", { name, exact: true });

/** The six screens; each notes which frame it shows since when, by the machine's clock. */
async function watch(context: BrowserContext, url: string): Promise<Page[]> {
  return Promise.all(TILES.map(async (tile) => {
    const page = await context.newPage();
    await page.goto(`${url}/wall?wall=six&tile=${tile}`);
    await expect(page.locator("#screen")).toHaveAttribute("data-frame", /\d+/);
    await page.evaluate(() => {
      const screen = document.querySelector("#screen");
      const seen: [number, number][] = [];
      (globalThis as unknown as { seen: [number, number][] }).seen = seen;
      new MutationObserver(() => seen.push([Date.now(), Number((screen as HTMLElement).dataset["frame"])])).observe(screen as Element, { attributeFilter: ["data-frame"] });
    });
    return page;
  }));
}

test("six screens of a wall that was laid out by hand stay in one frame", async ({ page, context, browser, url, complaints }) => {
  test.setTimeout(120_000);
  await page.goto(`${url}/#/wall`);
  await page.getByRole("link", { name: "New wall" }).click();
  await page.getByRole("textbox", { name: "Name", exact: true }).fill("Six");
  await expect(page.getByRole("textbox", { name: "Id" })).toHaveValue("six");
  await field(page, "Columns").fill("3");
  await field(page, "Rows").fill("2");
  await fill(page, "A tile's picture, px", [160, 90]);
  await fill(page, "A tile's size, m", [0.4, 0.225]);
  await fill(page, "Gaps, m", [0.01, 0.01]);
  await page.getByLabel("Frames, a second").fill("0");
  await expect(page.getByText("expected 0.5 to 60 frames a second, got 0")).toBeVisible();
  await expect(page.getByRole("button", { name: "Keep" })).toBeDisabled();
  await page.getByLabel("Frames, a second").fill("1");
  await expect(page.getByRole("group", { name: "From the front" }).locator("image")).toHaveAttribute("href", /^blob:/);
  // Undone and done again by keys, and a reload loses nothing of it.
  await page.getByRole("heading", { name: "Six" }).click();
  await page.keyboard.press("Control+z");
  await expect(page.getByLabel("Frames, a second")).not.toHaveValue("1");
  await page.keyboard.press("Control+Shift+z");
  await expect(page.getByLabel("Frames, a second")).toHaveValue("1");
  await page.reload();
  await expect(page.getByLabel("Frames, a second")).toHaveValue("1");
  await page.getByRole("button", { name: "Keep" }).click();
  await expect(page.getByText("As kept.")).toBeVisible();
  await expect(page).toHaveURL(/#\/wall\?wall=six$/);
  const told = (await (await page.request.get(`${url}/api/v1/walls/six`)).json()) as { rate_hz: number; surface: { grid: { columns: number; tile_px: number[] } } };
  expect([told.rate_hz, told.surface.grid.columns, told.surface.grid.tile_px]).toEqual([1, 3, [160, 90]]);

  const screens = await watch(context, url);
  // The pages note themselves what they show, since asking six takes longer than a frame. Once all are connected, let frames pass.
  const newest = () => Promise.all(screens.map((screen) => screen.evaluate(() => (globalThis as unknown as { seen: [number, number][] }).seen.at(-1)?.[1] ?? 0)));
  await expect.poll(async () => Math.min(...(await newest()))).toBeGreaterThan(0);
  const begun = Math.max(...(await newest())) + SETTLED_FRAMES;
  await expect.poll(async () => Math.min(...(await newest())), { timeout: 40_000 }).toBeGreaterThan(begun + SAMPLES);
  const histories = await Promise.all(screens.map((screen) => screen.evaluate(() => (globalThis as unknown as { seen: [number, number][] }).seen)));
  const from = Math.max(...histories.map((history) => history.find(([, frame]) => frame >= begun)?.[0] ?? Infinity));
  const until = Math.min(...histories.map((history) => history.at(-1)?.[0] ?? 0));
  const shownAt = (history: [number, number][], at: number) => history.filter(([time]) => time <= at).at(-1)?.[1] ?? 0;
  expect(until - from).toBeGreaterThan((SAMPLES * FRAME_MILLIS) / 2);
  let apartSince: number | null = null;
  let n = { together: 0, apart: 0 };
  for (let at = from; at <= until; at += 20) {
    const frames = histories.map((history) => shownAt(history, at));
    const steps = new Set(frames).size;
    // Mid-switch at most: two frames that follow one another (frames are left out of all tiles alike where there is too much to
    // draw), for less than a frame's time.
    expect(steps, `${at - from} ms: ${frames.join()}`).toBeLessThanOrEqual(2);
    apartSince = steps === 1 ? null : (apartSince ?? at);
    expect(at - (apartSince ?? at), `${at - from} ms: ${frames.join()}`).toBeLessThan(FRAME_MILLIS);
    n = { together: n.together + (steps === 1 ? 1 : 0), apart: n.apart + (steps === 1 ? 0 : 1) };
  }
  expect(n.together).toBeGreaterThan(4 * n.apart);
  await expect.poll(async () => new Set(await newest()).size).toBe(1);

  // The place Wall knows of them, and of one of another browser, and has all of them say who they are.
  const elsewhere = await browser.newContext();
  const seventh = await elsewhere.newPage();
  await seventh.goto(`${url}/wall?wall=six&tile=r1c1`);
  await page.bringToFront();
  await expect(page.getByText("7 connected.")).toBeVisible();
  await expect(page.getByText("All show the same frame.")).toBeVisible();
  await expect(page.getByText("2 screens show it.")).toBeVisible();
  // Frames are missed by all of them alike where there is too much to draw.
  await expect(page.getByText(/\d+ missed, \d+ late, 0 reconnects/).first()).toBeVisible();
  const one = screens[0];
  if (!one) throw new Error("there are six");
  await page.getByText("Identify", { exact: true }).click();
  for (const screen of [...screens, seventh]) await expect(screen.locator("#screen")).toHaveAttribute("data-pattern", "true");
  await expect(page.getByRole("radio", { name: "Identify" })).toBeChecked();
  await page.getByText("Picture", { exact: true }).click();
  for (const screen of [one, seventh]) await expect(screen.locator("#screen")).toHaveAttribute("data-pattern", "false");
  await elsewhere.close();
  await expect(page.getByText("6 connected.")).toBeVisible();
  // What a screen tells of itself.
  await one.keyboard.press("h");
  await expect(one.locator("#health")).toContainText("5 in step");
  await one.keyboard.press("h");
  await expect(one.locator("#health")).toBeHidden();
  complaints.length = 0;
});

test("tiles are moved by hand, versions come back, and what somebody else kept is not lost", async ({ page, request, url, complaints }) => {
  const grid = { columns: 2, rows: 1, tile_px: [160, 90], tile_m: [0.4, 0.225], gap_m: [0.01, 0.01] };
  const wall = { name: "Lobby", scene: "plaza", rate_hz: 2, view: { eye_m: [0, -14, 5], target_m: [0, 2, 1] }, surface: { grid } };
  const made = await request.put(`${url}/api/v1/walls/lobby`, { data: wall, headers: { "If-None-Match": "*" } });
  expect(made.status(), await made.text()).toBe(201);
  await page.goto(`${url}/#/wall?wall=lobby`);
  await page.getByText("Free", { exact: true }).click();
  const front = page.getByRole("group", { name: "From the front" });
  const tile = front.getByRole("button", { name: /^Tile r1c2/ });
  const box = await tile.boundingBox();
  if (!box) throw new Error("the tile is drawn");
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 4);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 40, box.y + box.height / 4 - 60, { steps: 4 });
  await page.mouse.up();
  await expect(tile).toBeFocused();
  await expect(page.getByRole("combobox", { name: "Tile" })).toHaveValue("1");
  const middle = page.getByRole("group", { name: "Its middle, m" }).getByRole("spinbutton");
  expect(Number(await middle.nth(1).inputValue())).toBeGreaterThan(0.02);
  await page.keyboard.press("Shift+ArrowDown");
  const before = Number(await middle.nth(1).inputValue());
  await page.keyboard.press("ArrowUp");
  await expect.poll(async () => Number(await middle.nth(1).inputValue()) - before).toBeCloseTo(0.01, 4);
  await page.getByRole("button", { name: "Keep", exact: true }).click();
  await expect(page.getByText("As kept.")).toBeVisible();

  // Somebody else renames it meanwhile.
  const tag = (await request.get(`${url}/api/v1/walls/lobby`)).headers()["etag"] ?? "";
  const renamed = await request.patch(`${url}/api/v1/walls/lobby`, { data: { name: "Entrance" }, headers: { "If-Match": tag } });
  expect(renamed.status()).toBe(200);
  await page.getByLabel("Frames, a second").fill("3");
  await page.getByRole("button", { name: "Keep", exact: true }).click();
  await expect(page.getByRole("alert").filter({ hasText: "Somebody else changed this wall" })).toBeVisible();
  await page.getByRole("button", { name: "Discard changes" }).click();
  await page.getByRole("button", { name: "Discard changes" }).click();
  await expect(page.getByRole("heading", { name: "Entrance" })).toBeVisible();

  await page.getByText("Versions", { exact: true }).click();
  await page.getByRole("button", { name: "Take version 1 into the draft" }).click();
  await expect(page.getByText("Changed, not kept yet.")).toBeVisible();
  await expect(page.getByRole("radio", { name: "Grid" })).toBeChecked();
  await page.getByRole("button", { name: "Undo" }).click();
  await expect(page.getByRole("radio", { name: "Free" })).toBeChecked();
  await page.getByRole("button", { name: "Restore version 1" }).click();
  await expect(page.getByRole("heading", { name: "Lobby" })).toBeVisible();
  await expect(page.getByLabel("Columns")).toHaveValue("2");

  await page.getByRole("button", { name: "Remove wall" }).click();
  await page.getByRole("button", { name: "Remove wall" }).click();
  await expect(page.getByRole("heading", { name: "Walls" })).toBeVisible();
  expect((await request.get(`${url}/api/v1/walls/lobby`)).status()).toBe(404);
  // The browser tells of the change that was refused.
  expect(complaints.filter((text) => !text.includes("412"))).toEqual([]);
  complaints.length = 0;
});
