// Somebody is followed from camera to camera, and stays the same.

import { expect, forgiveBusy, fused, test } from "./page";

forgiveBusy();

test("somebody is followed across three cameras, and Esc ends it", async ({ page, url }) => {
  test.setTimeout(150_000);
  await page.goto(url);
  await fused(page);
  let id = "";
  const panel = page.locator("[data-follow]");
  const everSeenBy = async () => ((await panel.locator("[data-ever]").getAttribute("data-ever")) ?? "").split(" ").sort().join(" ");
  // A machine that is too busy for its cameras loses people; then somebody else is followed.
  await expect(async () => {
    // Who has been there for longest goes round the plaza again and again.
    const people = page.locator(".person:not(.is-lost)");
    await expect(people.first()).toBeVisible();
    id = String(Math.min(...(await people.evaluateAll((labels) => labels.map((label) => Number((label as HTMLElement).dataset["person"]))))));
    if ((await panel.count()) === 0 || (await panel.getAttribute("data-follow")) !== id) {
      await page.locator(`.person[data-person="${id}"]`).focus();
      await page.keyboard.press("f");
    }
    await expect(page.getByRole("region", { name: `Following ${id}` })).toBeVisible();
    await expect.poll(everSeenBy, { timeout: 35_000 }).toBe("east north west");
  }).toPass({ timeout: 120_000 });
  await expect(panel).toHaveAttribute("data-follow", id);
  await expect(page).toHaveURL(new RegExp(`follow=${id}`));
  await expect(panel.locator(".crop img:not(.is-empty)")).toBeVisible();
  await page.keyboard.press("Escape");
  await expect(panel).toHaveCount(0);
  await expect(page).not.toHaveURL(/follow=/);
});

test("a place says which cameras see it, and a cone of the map leads to its camera", async ({ page, url }) => {
  await page.goto(`${url}/#/operate?eye=0,-18,9&target=0,-4,0&fov=50&map=large&labels=off`);
  const stage = await fused(page);
  await stage.press("Enter");
  const panel = page.getByRole("region", { name: "Who sees this place" });
  await expect(panel.getByText(/\d of 3 cameras see it/)).toBeVisible();
  await expect(panel.locator("[data-sees=true]").first()).toContainText("pixels a metre");
  await expect(panel.locator(".spot")).toBeVisible();
  await expect(page).toHaveURL(/mark=-?0\.\d\d,-4\.\d\d,/);
  await page.keyboard.press("Escape");
  await expect(panel).toHaveCount(0);
  await page.getByRole("button", { name: /Camera North side, live/ }).press("Enter");
  await expect(page.locator(".alone").getByRole("heading", { name: "North side" })).toBeVisible();
  await page.keyboard.press("Escape");
  await expect(await fused(page)).toHaveAttribute("data-view", /"eye":\[0,-18,9\]/);
});
