// Operate: a fused picture, turned by keys; cameras; time; and that the place survives going away and reloading.

import { apart, digest, expect, forgiveBusy, fused, test } from "./page";

forgiveBusy();

test("the page shows the scene, and keys turn it", async ({ page, url }) => {
  await page.goto(url);
  const stage = await fused(page);
  await expect(page).toHaveTitle("Plaza · videofields");
  await expect(page.locator(".camera")).toHaveCount(3);
  await expect(page.locator(".camera[data-state=live] img:not(.is-empty)")).toHaveCount(3);
  const before = await digest(page);
  expect(apart(before, before.replace(/\d+/g, "0"))).toBeGreaterThan(20);
  const view = await stage.getAttribute("data-view");
  await stage.focus();
  for (let i = 0; i < 8; i += 1) await stage.press("ArrowRight");
  await expect(stage).not.toHaveAttribute("data-view", view ?? "");
  await expect.poll(async () => apart(before, await digest(page))).toBeGreaterThan(4);
  await expect(page).toHaveURL(/eye=[-\d.,]+/);
  await stage.press("0");
  await expect(stage).toHaveAttribute("data-view", view ?? "");
  await expect(page).not.toHaveURL(/eye=/);
});

test("a camera's own picture and back keep the place, and so does reloading", async ({ page, url }) => {
  await page.goto(`${url}/#/operate?eye=12,-20,9&target=0,0,0&fov=50`);
  const stage = await fused(page);
  await expect(stage).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await page.getByRole("button", { name: "Show camera North side alone" }).click();
  const alone = page.locator(".alone");
  await expect(alone.getByRole("heading", { name: "North side" })).toBeVisible();
  await expect(alone.locator("img:not(.is-empty)")).toBeVisible();
  await alone.getByRole("button", { name: /^Picture of camera/ }).click({ position: { x: 200, y: 250 } });
  await expect(alone.locator(".located")).toContainText("a pixel");
  await alone.getByRole("button", { name: "Next camera" }).click();
  await expect(alone.getByRole("heading", { name: "South-west corner" })).toBeVisible();
  await page.keyboard.press("Escape");
  await expect(await fused(page)).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await page.goBack();
  await expect(alone).toBeVisible();
  await page.goBack();
  await fused(page);
  await page.reload();
  await expect(await fused(page)).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await page.getByRole("link", { name: "System" }).click();
  await expect(page.getByRole("heading", { name: "System" })).toBeVisible();
  await page.getByRole("link", { name: "Operate" }).click();
  await expect(await fused(page)).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
});

test("a click on the timeline goes back in time, and Live comes back", async ({ page, url }) => {
  await page.goto(url);
  const stage = await fused(page);
  const strip = page.getByRole("slider");
  await expect(strip).toHaveAttribute("data-rows", "3");
  await strip.focus();
  await strip.press("Shift+ArrowLeft");
  for (let i = 0; i < 3; i += 1) await strip.press("ArrowLeft");
  await expect(page).toHaveURL(/at=2/);
  await expect(stage).toContainText("Past");
  const wanted = () => Date.parse(decodeURIComponent(/at=([^&]+)/.exec(page.url())?.[1] ?? ""));
  const away = async () => Math.abs(Number(await stage.getAttribute("data-time")) - wanted());
  await expect.poll(away).toBeLessThan(2);
  await page.reload();
  await expect.poll(away).toBeLessThan(2);
  const span = async () => Number(await strip.getAttribute("aria-valuemax")) - Number(await strip.getAttribute("aria-valuemin"));
  const wide = await span();
  await strip.hover();
  await page.mouse.wheel(0, -300);
  await expect.poll(span).toBeLessThan(wide / 1.5);
  await page.getByRole("button", { name: "Live", exact: true }).click();
  await expect(stage).toContainText("Live");
  await expect(page).not.toHaveURL(/at=/);
});

test("a view is kept under a name, gone to by its number, renamed and removed", async ({ page, url }) => {
  await page.goto(`${url}/#/operate?eye=12,-20,9&target=0,0,0&fov=50&side=views`);
  const stage = await fused(page);
  const views = page.getByRole("region", { name: "Views" });
  await views.getByLabel("Name").fill("Gate");
  await views.getByRole("button", { name: "Keep this view" }).click();
  await expect(views.getByRole("button", { name: /1 Gate/ })).toBeVisible();
  await page.getByRole("button", { name: "Reset view" }).click();
  await expect(page).not.toHaveURL(/eye=12/);
  await page.keyboard.press("1");
  await expect(page).toHaveURL(/eye=12,-20,9/);
  await expect(stage).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await views.getByRole("button", { name: "Rename Gate" }).click();
  await views.getByLabel("Name").first().fill("South gate");
  await views.getByRole("button", { name: "Rename", exact: true }).click();
  await expect(views.getByRole("button", { name: /1 South gate/ })).toBeVisible();
  await views.getByRole("button", { name: "Remove South gate" }).click();
  await views.getByRole("button", { name: "Remove it" }).click();
  await expect(views.getByText("No view of this scene is kept yet.")).toBeVisible();
});

test("where cameras meet is chosen, asked for and kept in the address", async ({ page, url }) => {
  await page.goto(`${url}/#/operate?eye=0,-14,6&target=0,0,0&fov=50`);
  await fused(page);
  await page.getByText("Picture", { exact: true }).click();
  const asked = page.waitForResponse((response) => response.url().includes("fields=montage") && response.ok());
  await page.getByText("Smooth seams", { exact: true }).click();
  await expect(page).toHaveURL(/fields=montage/);
  expect((await asked).headers()["videofields-settings"]).toContain("fields=montage");
  await page.getByText("Pixel by pixel", { exact: true }).click();
  await expect(page).not.toHaveURL(/fields=/);
});

test("walking goes over the ground, and what is shown is kept as a snapshot", async ({ page, url }) => {
  test.setTimeout(120_000);
  await page.goto(`${url}/#/operate?eye=0,-14,6&target=0,0,0&fov=50&side=keep`);
  const stage = await fused(page);
  await page.getByText("Walk", { exact: true }).click();
  await expect(page).toHaveURL(/eye=0,-14,1\.7&/);
  await stage.focus();
  await page.keyboard.down("w");
  await expect(page).not.toHaveURL(/eye=0,-14,/);
  await page.keyboard.up("w");
  // How far depends on when the key was let go; over the ground all the way.
  await expect(page).toHaveURL(/eye=-?[\d.e-]+,-(?:1[0-3]|\d)(?:\.\d+)?,1\.7&/);
  const keep = page.getByRole("region", { name: "Snapshot" });
  await keep.getByLabel("Note").fill("case 7");
  // A machine that is too busy says so within seconds, and is asked again.
  await expect(async () => {
    await keep.getByRole("button", { name: "Keep what is shown" }).click();
    await expect(keep.getByText("It is kept and sealed.")).toBeVisible({ timeout: 12_000 });
  }).toPass({ timeout: 90_000 });
  await expect(keep.getByRole("listitem").filter({ hasText: "case 7" }).getByRole("link", { name: "Archive" }).first()).toHaveAttribute("href", /archive\.tar$/);
});
