// Set-up, Geometry: things are drawn, moved, renamed and undone by pointer and keys, what is wrong is refused, and reloading loses
// nothing. Nothing is saved: the daemon's scene stays as it is.

import type { Page } from "@playwright/test";
import { expect, test } from "./page";

const ADDRESS = "#/setup?stage=geometry&scene=plaza&live=off&grid=0.5";

/** The map, with what brings metres of the world to pixels of it: as far as everything is shown, its middle is the world's origin. */
async function openMap(page: Page, url: string) {
  await page.goto(`${url}/${ADDRESS}&layout=map`);
  const map = page.getByRole("application", { name: "Map of what stands there" });
  await expect(map.getByText("cafe")).toBeVisible();
  const box = await map.boundingBox();
  if (!box) throw new Error("there is no map");
  const bar = await map.locator(".plan-bar").boundingBox();
  const metres = Number.parseFloat(await map.locator(".plan-scale").innerText().then((text) => /([\d.]+) m/.exec(text)?.[1] ?? ""));
  const scale = (bar?.width ?? 0) / metres;
  const at = ([x, y]: readonly [number, number]) => ({ x: box.width / 2 + x * scale, y: box.height / 2 - y * scale });
  const drag = async (from: readonly [number, number], to: readonly [number, number]) => {
    const [a, b] = [at(from), at(to)];
    await page.mouse.move(box.x + a.x, box.y + a.y);
    await page.mouse.down();
    await page.mouse.move(box.x + (a.x + b.x) / 2, box.y + (a.y + b.y) / 2);
    await page.mouse.move(box.x + b.x, box.y + b.y);
    await page.mouse.up();
  };
  const click = (place: readonly [number, number]) => map.click({ position: at(place) });
  return { map, drag, click };
}

const field = (page: Page, label: string) => page.getByRole("region", { name: "What is chosen" }).getByLabel(label, { exact: true });

test("a box is drawn, raised, moved, undone and redone, and is there after reloading", async ({ page, url }) => {
  const { map, drag } = await openMap(page, url);
  await page.getByRole("button", { name: "Box", exact: true }).click();
  await drag([-4, -3], [2, -7]);
  await expect(page.getByLabel("Height", { exact: true })).toBeFocused();
  await page.keyboard.type("4.5");
  await page.keyboard.press("Enter");
  await expect(page.getByRole("heading", { name: "box", exact: true })).toBeVisible();
  await expect(field(page, "Length")).toHaveValue("6");
  await expect(field(page, "Width")).toHaveValue("4");
  await expect(field(page, "Height")).toHaveValue("4.5");
  await expect(field(page, "z")).toHaveValue("0");
  const x = Number(await field(page, "x").inputValue());
  await map.focus();
  for (let i = 0; i < 3; i += 1) await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowUp");
  await expect(field(page, "x")).toHaveValue(String(Number((x + 0.3).toFixed(3))));
  await expect(field(page, "y")).toHaveValue("-4");
  // The arrows are one step, drawing another.
  await page.keyboard.press("Control+z");
  await expect(field(page, "x")).toHaveValue(String(x));
  await page.keyboard.press("Control+z");
  await expect(page.getByRole("heading", { name: "box", exact: true })).toHaveCount(0);
  await page.keyboard.press("Control+y");
  await page.keyboard.press("Control+y");
  await expect(field(page, "y")).toHaveValue("-4");
  await field(page, "Name").fill("cafe");
  await field(page, "Name").press("Enter");
  await expect(page.getByText("Something else has this name")).toBeVisible();
  await field(page, "Name").fill("stall");
  await field(page, "Name").press("Enter");
  await expect(page.getByRole("heading", { name: "stall", exact: true })).toBeVisible();
  await expect(page).toHaveURL(/thing=stall/);
  await page.reload();
  await expect(field(page, "Height")).toHaveValue("4.5");
  await expect(field(page, "y")).toHaveValue("-4");
  await expect(page.getByRole("button", { name: "stall", exact: true })).toBeVisible();
});

test("a footprint is drawn; one that crosses itself is refused", async ({ page, url }) => {
  const { map, click } = await openMap(page, url);
  const status = page.locator(".geo-said");
  await map.focus();
  await page.keyboard.press("f");
  for (const corner of [[-6, -2], [0, -2], [0, -8]] as const) await click(corner);
  await click([-3, 2]);
  await expect(status).toContainText("must not cross itself");
  await click([3, -8]);
  await click([3, -5]);
  await expect(status).not.toContainText("must not cross itself");
  // The edge that closes it would.
  await map.press("Enter");
  await expect(status).toContainText("must not cross itself");
  await map.press("Backspace");
  await map.press("Backspace");
  await map.press("Enter");
  await expect(page.getByLabel("Height", { exact: true })).toBeFocused();
  await page.keyboard.type("5");
  await page.keyboard.press("Enter");
  await expect(page.getByRole("heading", { name: "footprint", exact: true })).toBeVisible();
  await page.getByText("Corners (3)").click();
  await expect(field(page, "1 x")).toHaveValue("-6");
  await page.getByRole("button", { name: "Add a corner after 3" }).click();
  await field(page, "4 x").fill("4");
  await expect(page.getByRole("alert").filter({ hasText: "must not cross itself" })).toBeVisible();
  await expect(page.getByRole("button", { name: "footprint ! needs mending" })).toBeVisible();
  await field(page, "4 x").fill("-9");
  await expect(page.getByRole("alert").filter({ hasText: "must not cross itself" })).toHaveCount(0);
});

test("in 3D what is chosen is dragged and raised by its handles", async ({ page, url }) => {
  await page.goto(`${url}/${ADDRESS}&layout=view&thing=cafe`);
  const handle = page.locator(".geo-overlay .is-top path");
  await expect(handle).toBeVisible();
  const box = await handle.boundingBox();
  if (!box) throw new Error("there is no handle");
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2, box.y - 30, { steps: 3 });
  await page.mouse.up();
  await expect.poll(async () => Number(await field(page, "Height").inputValue())).toBeGreaterThan(4.4);
  await expect(field(page, "z")).toHaveValue("0");
  await page.getByRole("button", { name: /^↶|Undo/ }).first().click();
  await expect(field(page, "Height")).toHaveValue("4");
  // By keys: a copy of its own name, the next thing, and away with it.
  await page.getByRole("application", { name: "View of what stands there" }).focus();
  await page.keyboard.press("d");
  await expect(page).toHaveURL(/thing=cafe-2/);
  await page.keyboard.press("Delete");
  await expect(page.getByRole("button", { name: "cafe-2", exact: true })).toHaveCount(0);
  await page.keyboard.press("Enter");
  await expect(page).toHaveURL(/thing=hall/);
  await page.keyboard.press("Tab");
  await expect(page).toHaveURL(/thing=cafe/);
  await page.keyboard.press("r");
  await expect(field(page, "Turn")).toHaveValue("33");
  await page.keyboard.press("Escape");
  await expect(page).not.toHaveURL(/thing=/);
});
