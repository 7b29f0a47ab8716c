// The ground, from an empty store: a picture from above, laid out by the north and a known length; its place on the earth; a corner
// moved by keys. Nothing of it is lost by a reload, and the daemon has all of it once it is saved.

import { resolve } from "node:path";
import { type Daemon, daemon } from "./daemon";
import { expect, test } from "./page";

const PICTURE = resolve(import.meta.dirname, "../../docs/images/fused-plaza-map.jpg");

let own: Daemon;

test.beforeAll(async () => {
  own = await daemon("setup-ground", { config: "" });
});
test.afterAll(async () => {
  await own.stop();
});

type Told = { origin?: { latitude_deg: number }; ground?: { polygon: number[][]; imagery?: { file: string; control_points: { pixel: number[]; world: number[] }[] } }[] };

test("a picture is laid out on the ground, kept over a reload, and saved", async ({ page }) => {
  await page.goto(`${own.url}/#/setup?stage=ground`);
  await page.getByLabel("Name").first().fill("Market square");
  await page.locator("input[type=file]").setInputFiles(PICTURE);
  const picture = page.locator(".ground-picture");
  await expect(picture).toBeVisible();
  await expect(page.getByLabel("Scale")).toHaveValue("0.0625");

  const map = page.getByRole("application");
  const box = await map.boundingBox();
  if (!box) throw new Error("no map");
  const drag = async (from: readonly [number, number], to: readonly [number, number]) => {
    await page.mouse.move(box.x + from[0], box.y + from[1]);
    await page.mouse.down();
    await page.mouse.move(box.x + to[0], box.y + to[1], { steps: 4 });
    await page.mouse.up();
  };
  await page.getByRole("button", { name: "North", exact: true }).click();
  await drag([300, 200], [400, 200]);
  await expect(page.getByLabel("Turn")).toHaveValue("90");
  await page.getByRole("button", { name: "Known length" }).click();
  await drag([300, 100], [300, 300]);
  const length = page.getByLabel("The line is really");
  await length.fill("30");
  await length.press("Enter");
  await expect(page.getByLabel("Scale")).not.toHaveValue("0.0625");
  const scale = await page.getByLabel("Scale").inputValue();

  await page.getByRole("button", { name: /^Corner 1 at/ }).focus();
  await page.keyboard.press("Shift+ArrowLeft");
  await expect(page.getByLabel("1: x, m").first()).toHaveValue("-21");
  await page.getByLabel("Latitude, longitude").fill("52.0903, 5.1212");
  await expect(page.getByText("100 m east are 0.001459")).toBeVisible();

  await page.reload();
  await expect(picture).toBeVisible();
  await expect(page.getByLabel("Scale")).toHaveValue(scale);

  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText(/^Kept at/)).toBeVisible();
  const scene = (await (await fetch(`${own.url}/api/v1/scenes/market-square`)).json()) as Told;
  expect(scene.origin?.latitude_deg).toBe(52.0903);
  expect(scene.ground?.[0]?.polygon[0]).toEqual([-21, -11.25]);
  const imagery = scene.ground?.[0]?.imagery;
  expect(imagery?.control_points).toHaveLength(4);
  expect((await fetch(`${own.url}/api/v1/${imagery?.file ?? ""}`)).headers.get("Content-Type")).toBe("image/jpeg");
  await expect(page.getByRole("link", { name: "Look at it in Operate" })).toHaveAttribute("href", /scene=market-square/);
});
