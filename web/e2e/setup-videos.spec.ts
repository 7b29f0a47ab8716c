// Set-up's frame and its videos, from an empty store: a file's picture before it is kept, errors at their field, a part of it, undo,
// and that neither going away nor reloading loses or keeps anything. Then it is saved.

import { resolve } from "node:path";
import type { Page } from "@playwright/test";
import { DEMO, type Daemon, daemon } from "./daemon";
import { expect, test } from "./page";

const CLIP = resolve(DEMO, "clips/west.webm");

let own: Daemon;

test.beforeAll(async () => {
  own = await daemon("setup-videos", { config: "" });
});
test.afterAll(async () => {
  await own.stop();
});

async function kept(): Promise<string[]> {
  const answer = await fetch(`${own.url}/api/v1/cameras`);
  return ((await answer.json()) as { cameras: { id: string }[] }).cameras.map(({ id }) => id);
}

const picture = (page: Page) => page.locator(".source-picture img");

test("a video is added, cut, undone, left and found again, and kept only when that is asked for", async ({ page, complaints }) => {
  await page.goto(`${own.url}/#/setup`);
  await expect(page.getByRole("heading", { name: "No video yet" })).toBeVisible();
  await expect(page.getByRole("button", { name: "Save" })).toBeDisabled();
  await page.getByRole("button", { name: "File", exact: true }).click();

  const path = page.getByLabel("Path on the daemon's machine");
  await path.fill(`${CLIP}.missing`);
  await path.press("Enter");
  await expect(page.locator(".fault:not(:empty)")).toContainText(".missing");
  // The browser tells of the refusal.
  expect(complaints.filter((text) => !text.includes("status of 4"))).toEqual([]);
  complaints.length = 0;

  await page.getByRole("searchbox", { name: "Search" }).fill("west");
  await page.getByRole("radio", { name: /west\.webm/ }).check();
  await expect(picture(page)).toBeVisible();
  await expect(page.getByText("640 × 360")).toBeVisible();
  await expect(page.locator(".fault:not(:empty)")).toHaveCount(0);
  await expect(page.getByLabel("Name").last()).toHaveValue("West");
  await expect(page.getByLabel("Id").last()).toHaveValue("west");

  const begin = page.getByRole("slider", { name: "Begins at" });
  await begin.focus();
  for (let i = 0; i < 2; i += 1) await begin.press("Shift+ArrowRight");
  await expect(begin).toHaveAttribute("aria-valuenow", "2");
  await page.keyboard.press("Control+z");
  await expect(begin).toHaveAttribute("aria-valuenow", "0");
  await page.keyboard.press("Control+Shift+z");
  await expect(begin).toHaveAttribute("aria-valuenow", "2");
  await page.keyboard.press("Control+z");
  await page.keyboard.press("Control+y");
  await expect(begin).toHaveAttribute("aria-valuenow", "2");

  await page.getByRole("link", { name: "Operate" }).click();
  await page.getByRole("link", { name: "Set-up", exact: true }).click();
  await expect(begin).toHaveAttribute("aria-valuenow", "2");
  await page.reload();
  await expect(page.getByText("Here is what you left")).toBeVisible();
  await expect(begin).toHaveAttribute("aria-valuenow", "2");
  await expect(picture(page)).toBeVisible();
  expect(await kept()).toEqual([]);

  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText(/^Kept at/)).toBeVisible();
  expect(await kept()).toEqual(["west"]);
  await expect(page.getByRole("status").filter({ hasText: "Everything is kept." })).toBeVisible();
  await expect(page.getByRole("button", { name: /West/ }).filter({ hasText: "live" })).toBeVisible();
});

test("a camera is removed only once that is saved, and the question can be refused", async ({ page }) => {
  await page.goto(`${own.url}/#/setup`);
  await page.getByRole("button", { name: "Remove camera" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByRole("heading", { name: "West" })).toBeVisible();
  await page.getByRole("button", { name: "Remove camera" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Remove camera" }).click();
  await expect(page.getByText("West taken away")).toBeVisible();
  expect(await kept()).toEqual(["west"]);
  await page.getByRole("button", { name: "Save" }).click();
  await expect.poll(kept).toEqual([]);
  await expect(page.getByText(/^Kept at/)).toBeVisible();
});
