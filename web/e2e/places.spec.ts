// Every place is read out right, in light and dark; the wall's screen shows its tile.

import { findings } from "./axe";
import { expect, fused, test } from "./page";

for (const colorScheme of ["light", "dark"] as const) {
  test(`nothing keeps people out of any place (${colorScheme})`, async ({ page, url }) => {
    await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
    await page.goto(url);
    await fused(page);
    expect(await findings(page)).toEqual([]);
    for (const name of ["Set-up", "Wall", "System"]) {
      await page.getByRole("link", { name, exact: true }).click();
      await expect(page.locator("main h1")).toBeVisible();
      await expect(page.getByText("Loading …")).toHaveCount(0);
      expect(await findings(page), name).toEqual([]);
    }
  });
}

test("colours are chosen and kept", async ({ page, url }) => {
  await page.emulateMedia({ colorScheme: "light" });
  await page.goto(`${url}/#/system`);
  await page.getByLabel("Colours").selectOption("dark");
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  expect(await ground()).toBe("rgb(14, 21, 24)");
  await page.reload();
  await expect(page.getByRole("heading", { name: "System" })).toBeVisible();
  expect(await ground()).toBe("rgb(14, 21, 24)");
});

test("System and Set-up say what there is", async ({ page, url }) => {
  await page.goto(`${url}/#/system`);
  await expect(page.getByRole("region", { name: "Cameras" }).getByRole("row")).toHaveCount(4);
  await page.getByRole("link", { name: "Users" }).click();
  await expect(page.getByText("There are no users")).toBeVisible();
  await page.getByRole("link", { name: "Plan" }).click();
  await expect(page.getByRole("cell", { name: "camera depth" })).toBeVisible();
  await page.goto(`${url}/#/setup`);
  await expect(page.getByRole("combobox", { name: "Scene" })).toHaveValue("plaza");
  await expect(page.getByRole("heading", { name: "South-west corner" })).toBeVisible();
});

test("a screen of a wall shows its tile, and others are found", async ({ page, request, url }) => {
  const grid = { columns: 2, rows: 1, tile_px: [160, 90], tile_m: [0.4, 0.225], gap_m: [0.01, 0.01] };
  const wall = { name: "Control room", scene: "plaza", rate_hz: 2, view: { eye_m: [0, -14, 5], target_m: [0, 2, 1] }, surface: { grid } };
  const kept = await request.put(`${url}/api/v1/walls/control`, { data: wall, headers: { "If-None-Match": "*" } });
  expect([201, 412]).toContain(kept.status());
  await page.goto(`${url}/#/wall`);
  await expect(page.getByRole("link", { name: "Screen r1c2 of Control room, 160 × 90 pixels" })).toHaveAttribute("href", "/wall?wall=control&tile=r1c2");
  await page.goto(`${url}/wall`);
  await page.locator('a[href="/wall?wall=control&tile=r1c1"]').click();
  const screen = page.locator("#screen");
  await expect(screen).toHaveAttribute("data-frame", /\d+/);
  const first = Number(await screen.getAttribute("data-frame"));
  await expect.poll(async () => Number(await screen.getAttribute("data-frame"))).toBeGreaterThan(first);
  await expect(page).toHaveTitle("r1c1 of control");
  await page.keyboard.press("t");
  await expect.poll(async () => Number(await screen.getAttribute("data-frame"))).toBeGreaterThan(first + 2);
});
