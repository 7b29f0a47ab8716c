// The whole set-up of the plaza, from an empty store to a fused view, by pointer and keyboard, as somebody would who knows the place
// and not the cameras; what comes out is held to the truth. The daemon is restarted in the middle: nothing is lost.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { type Page } from "@playwright/test";
import type { Point } from "../src/operate/orbit";
import { between, length, minus, point, quaternion } from "../src/setup/cameras/torch";
import type { Calibration, SceneDocument } from "../src/setup/draft";
import { calibrationIn, clickPicture, keyPicture, pairRows, picturePane, pixel, typePlace } from "./calibrating";
import { DEMO, type Daemon, daemon } from "./daemon";
import { counted, note } from "./figures";
import { expect, fused, test } from "./page";

const TRUTH = JSON.parse(readFileSync(resolve(DEMO, "plaza.json"), "utf8")) as SceneDocument;
const MOST_OFF_M = 0.1;
const MOST_OFF_DEGREES = 0.3;

/** Places that each camera sees: corners of hall and cafe, and points of the pavement that were measured. Six place a camera; north's
 * lens bends, and to find that too takes some more. */
const PLACES: Record<string, readonly Point[]> = {
  west: [[-1, 6.5, 0], [-1, 6.5, 6.4], [8.69826, -0.27139, 0], [14.785022, 1.706319, 4], [-10, -4, 0], [0, -10, 0]],
  east: [[-1, 6.5, 0], [-1, 6.5, 6.4], [8.69826, -0.27139, 4], [8.69826, -0.27139, 0], [0, -10, 0], [-10, -4, 0]],
  north: [[-1, 6.5, 0], [-1, 6.5, 6.4], [7.214978, 4.293681, 0], [8.69826, -0.27139, 4], [0, 0, 0], [8, -8, 0], [0, -10, 0], [4, 6, 0], [10, -6, 0]],
};
const BENT = "north";
const NAMES: Record<string, string> = { west: "West", east: "East", north: "North" };

let own: Daemon;

test.beforeAll(async () => {
  own = await daemon("setup-plaza", { config: "" });
});
test.afterAll(async () => {
  await own.stop();
});

async function addVideo(page: Page, id: string): Promise<void> {
  await page.getByRole("button", { name: "File", exact: true }).click();
  await page.getByRole("searchbox", { name: "Search" }).fill(id);
  await page.getByRole("radio", { name: new RegExp(`${id}\\.webm`) }).check();
  await expect(page.locator(".source-picture img")).toBeVisible();
  await expect(page.getByLabel("Id").last()).toHaveValue(id);
  await page.getByText("Begin again", { exact: true }).click();
}

async function addBox(page: Page, name: string): Promise<void> {
  const box = TRUTH.boxes?.find(({ id }) => id === name);
  if (!box) throw new Error(`the plaza has no ${name}`);
  const map = page.getByRole("application", { name: "Map of what stands there" });
  const place = await map.boundingBox();
  if (!place) throw new Error("there is no map");
  await page.getByRole("button", { name: "Box", exact: true }).click();
  // Drawn roughly; the numbers are typed.
  const [x, y] = [place.x + place.width / 2, place.y + place.height / 2];
  await page.mouse.move(x - 40, y - 30);
  await page.mouse.down();
  await page.mouse.move(x + 20, y + 10, { steps: 4 });
  await page.mouse.up();
  await page.keyboard.type(String(box.size_m[2]));
  await page.keyboard.press("Enter");
  const panel = page.getByRole("region", { name: "What is chosen" });
  const put = async (label: string, value: number | string) => {
    const field = panel.getByLabel(label, { exact: true });
    await field.fill(String(value));
    await field.press("Enter");
  };
  await put("Length", box.size_m[0] ?? 0);
  await put("Width", box.size_m[1] ?? 0);
  await put("x", box.center_m[0] ?? 0);
  await put("y", box.center_m[1] ?? 0);
  await put("Turn", box.yaw_deg ?? 0);
  await put("Name", name);
  await expect(panel.getByRole("heading", { name, exact: true })).toBeVisible();
}

test("the plaza is set up from nothing, and is seen as one", async ({ page, complaints }) => {
  test.setTimeout(240_000);
  const begun = performance.now();
  const effort = await counted(page);
  await page.goto(own.url);
  await page.getByRole("link", { name: /set up|set-up/i }).last().click();
  await expect(page.getByRole("heading", { name: "No video yet" })).toBeVisible();
  await page.getByLabel("Name").first().fill("Plaza");
  for (const id of ["west", "east", "north"]) await addVideo(page, id);
  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText(/^Kept at/)).toBeVisible();

  await page.getByRole("link", { name: /Next: Ground/ }).click();
  await page.getByLabel("Width (east)").fill("54");
  await page.getByLabel("Depth (north)").fill("44");
  await page.getByRole("button", { name: "Add rectangle" }).click();

  // A daemon that is restarted meanwhile is told of, and takes nothing away.
  await own.stop();
  await expect(page.getByText(/No answer from the daemon/)).toBeVisible();
  await own.start();
  await expect(page.getByText(/No answer from the daemon/)).toBeHidden();
  complaints.length = 0;

  await page.getByRole("link", { name: /4\. Geometry/ }).click();
  await page.getByRole("button", { name: "Map", exact: true }).or(page.getByText("Map", { exact: true })).first().click();
  for (const name of ["hall", "cafe"]) await addBox(page, name);

  await page.getByRole("link", { name: /3\. Cameras/ }).click();
  for (const [id, places] of Object.entries(PLACES)) {
    const truth = calibrationIn(TRUTH, id) as Calibration;
    await page.locator(`[data-camera=${id}]`).click();
    const pane = picturePane(page, NAMES[id] ?? id);
    await expect(page.getByRole("img", { name: `What ${NAMES[id] ?? id} shows` })).toBeVisible();
    if (id === BENT) await page.getByRole("checkbox", { name: "How the lens bends too" }).check();
    for (const [i, place] of places.entries()) {
      await typePlace(page, place);
      const at = pixel(truth, place);
      if (i === 0) await keyPicture(pane, at);
      else await clickPicture(pane, at);
      await expect(pairRows(page)).toHaveCount(i + 2);
    }
    // What was found of the last pair too is taken over, as one step with it.
    await expect(page.getByRole("button", { name: `Undo: Place ${NAMES[id] ?? id}` })).toBeVisible();
    await expect.poll(async () => Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeLessThan(1.5);
  }

  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText(/^Kept at/)).toBeVisible();
  await page.getByRole("link", { name: "Look at it in Operate" }).click();
  await fused(page);
  await expect(page).toHaveTitle("Plaza · videofields");
  const seconds = (performance.now() - begun) / 1e3;
  note("setup_plaza", { ...(await effort()), seconds: Math.round(seconds) });

  const kept = (await (await page.request.get(`${own.url}/api/v1/scenes/plaza`)).json()) as SceneDocument;
  for (const id of Object.keys(PLACES)) {
    const [found, truth] = [calibrationIn(kept, id), calibrationIn(TRUTH, id)];
    if (!found || !truth) throw new Error(`${id} is not calibrated`);
    const off = { metres: length(minus(point(found.position_m), point(truth.position_m))), degrees: between(quaternion(found.world_from_camera), quaternion(truth.world_from_camera)) };
    note(`setup_plaza_${id}`, off);
    expect.soft(off.metres, id).toBeLessThanOrEqual(MOST_OFF_M);
    expect.soft(off.degrees, id).toBeLessThanOrEqual(MOST_OFF_DEGREES);
  }
  const drawn = await page.request.get(`${own.url}/api/v1/scenes/plaza/view.jpg`);
  expect(drawn.headers()["videofields-sources"]?.split(",").length).toBe(3);
});
