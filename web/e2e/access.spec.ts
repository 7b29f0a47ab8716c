// Nothing keeps people out: every place, every part of it and the screens' pages, in light and dark.

import type { Page } from "@playwright/test";
import { findings } from "./axe";
import { expect, test } from "./page";

const SYSTEM = ["cameras", "load", "storage", "events", "users", "audit", "accuracy", "plan"];
const STAGES = ["videos", "ground", "cameras", "geometry"];

/** Looks at what is shown, in both. */
async function check(page: Page, what: string): Promise<void> {
  for (const colorScheme of ["light", "dark"] as const) {
    await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
    expect(await findings(page), `${what}, ${colorScheme}`).toEqual([]);
  }
}

const settled = async (page: Page) => {
  await expect(page.locator("main h1, main h2").first()).toBeVisible();
  await expect(page.getByText("Loading …")).toHaveCount(0);
};

test("System", async ({ page, url }) => {
  test.setTimeout(120_000);
  await page.goto(`${url}/#/system`);
  for (const part of SYSTEM) {
    await page.goto(`${url}/#/system?part=${part}`);
    await settled(page);
    if (part === "users") await page.getByRole("button", { name: "New user" }).click();
    if (part === "users") await page.getByLabel("Role").selectOption("viewer");
    await check(page, part);
  }
});

test("Set-up", async ({ page, url }) => {
  await page.goto(`${url}/#/setup`);
  for (const stage of STAGES) {
    await page.goto(`${url}/#/setup?stage=${stage}`);
    await settled(page);
    await check(page, stage);
  }
});

test("Operate, and a camera's own picture", async ({ page, url }) => {
  await page.goto(url);
  await expect(page.getByRole("application").first()).toHaveAttribute("data-time", /\d+/, { timeout: 60_000 });
  await check(page, "fused");
  await page.goto(`${url}/#/operate?camera=north`);
  await expect(page.getByRole("heading", { name: "North side" }).first()).toBeVisible();
  await check(page, "camera");
});

test("Wall, its editor, and a screen", async ({ page, request, url, complaints }) => {
  test.setTimeout(90_000);
  const grid = { columns: 2, rows: 1, tile_px: [160, 90], tile_m: [0.4, 0.225], gap_m: [0.01, 0.01] };
  const wall = { name: "Access", scene: "plaza", rate_hz: 2, view: { eye_m: [0, -14, 5], target_m: [0, 2, 1] }, surface: { grid } };
  const kept = await request.put(`${url}/api/v1/walls/access`, { data: wall, headers: { "If-None-Match": "*" } });
  expect([201, 412]).toContain(kept.status());
  await page.goto(`${url}/#/wall`);
  await settled(page);
  await check(page, "walls");
  await page.goto(`${url}/#/wall?wall=access`);
  await expect(page.getByRole("heading", { name: "Access" })).toBeVisible();
  await check(page, "grid");
  for (const kind of ["Curve", "Free"]) {
    await page.getByText(kind, { exact: true }).click();
    await page.getByLabel("Frames, a second").fill("0");
    await expect(page.getByText("expected 0.5 to 60 frames a second")).toBeVisible();
    await check(page, kind);
  }
  await page.goto(`${url}/wall`);
  await expect(page.getByRole("link", { name: "r1c1" }).first()).toBeVisible();
  await check(page, "choice");
  await page.goto(`${url}/wall?wall=access&tile=r1c1`);
  await expect(page.locator("#screen")).toHaveAttribute("data-frame", /\d+/);
  await page.keyboard.press("h");
  await check(page, "screen");
  // The browser tells of what the daemon found wrong when it was asked.
  complaints.splice(0, complaints.length, ...complaints.filter((text) => !text.includes("400")));
});
