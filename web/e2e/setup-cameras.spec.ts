// Calibrating by six pairs, by pointer and by keys, held to the truth; a camera in the hand; and that what the browser projects lies
// where the daemon draws it. Nothing is saved.

import type { Page } from "@playwright/test";
import type { Point, View } from "../src/operate/orbit";
import type { Calibration, SceneDocument } from "../src/setup/draft";
import { between, length, minus, point, quaternion } from "../src/setup/cameras/torch";
import { findings } from "./axe";
import { calibrationIn, clickPicture, clickScene, drag, keyPicture, onPane, onScene, pairRows, picturePane, pixel, scenePane, typePlace } from "./calibrating";
import { expect, test } from "./page";

const KEPT = "videofields.setup";

/** Places that camera west sees: corners of the hall and the cafe, and points of the ground. */
const PLACES = {
  hall: [-1, 6.5, 0], eaves: [-1, 6.5, 6.4], cafe: [8.697846, -0.271462, 0], roof: [14.784607, 1.706247, 4], near: [-10, -4, 0], right: [0, -10, 0],
} satisfies Record<string, Point>;

type Draft = { scene: { document: SceneDocument }; calibrating: Record<string, { pairs: unknown[]; lines: unknown[] }> };

const picture = (page: Page) => picturePane(page, "South-west corner");
const draftOf = async (page: Page) =>
  JSON.parse(await page.evaluate((key) => localStorage.getItem(key) ?? "null", KEPT)) as { draft: Draft } | null;
const calibrationOf = (document: SceneDocument | undefined) => calibrationIn(document, "west");

/** The stage with camera west, which has lost its calibration where `isBare`; answers the true one. */
async function open(page: Page, url: string, details: string, isBare: boolean): Promise<Calibration> {
  const told = await page.request.get(`${url}/api/v1/scenes/plaza`);
  const truth = calibrationOf((await told.json()) as SceneDocument);
  await page.goto(`${url}/#/setup?scene=plaza&stage=cameras&camera=west${details}`);
  await expect(page.getByRole("img", { name: "What South-west corner shows" })).toBeVisible();
  if (isBare) {
    await page.getByRole("button", { name: "Take the calibration away" }).click();
    await expect(page.getByText("This camera is not placed yet.")).toBeVisible();
  }
  if (!truth) throw new Error("the demo has no calibration");
  return truth;
}

test("six pairs by pointer and keys place a camera", async ({ page, url }) => {
  test.slow();
  const truth = await open(page, url, "", true);
  const at = (name: keyof typeof PLACES) => pixel(truth, PLACES[name]);

  // Picture first, scene first; a corner of a list; a point of the map; numbers.
  await clickPicture(picture(page), at("hall"));
  await clickScene(scenePane(page), PLACES.hall);
  await expect(pairRows(page)).toHaveCount(2);
  await clickScene(scenePane(page), PLACES.eaves);
  await clickPicture(picture(page), at("eaves"));
  await clickScene(scenePane(page), PLACES.cafe);
  await keyPicture(picture(page), at("cafe"));
  await expect(pairRows(page)).toHaveCount(4);
  await expect(page.getByText("3 more pairs and the camera can be found.")).toBeVisible();
  await keyPicture(picture(page), at("roof"));
  await page.getByLabel("Known place").selectOption("upper corner 2 of box cafe");
  await page.getByRole("button", { name: "Take this place" }).last().press("Enter");
  await page.getByText("From above", { exact: true }).click();
  // Closer, points of a finer grid are meant.
  await scenePane(page).hover({ position: await onScene(scenePane(page), PLACES.near) });
  await page.mouse.wheel(0, -600);
  await clickScene(scenePane(page), PLACES.near);
  await clickPicture(picture(page), at("near"));
  await typePlace(page, PLACES.right);
  await clickPicture(picture(page), at("right"));
  await expect(pairRows(page)).toHaveCount(7);

  await expect(page.getByText("taken over")).toBeVisible();
  await expect.poll(async () => Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeLessThan(1);
  await expect.poll(async () => calibrationOf((await draftOf(page))?.draft.scene.document)).toBeDefined();
  const found = calibrationOf((await draftOf(page))?.draft.scene.document) ?? truth;
  expect(length(minus(point(found.position_m), point(truth.position_m)))).toBeLessThan(0.1);
  expect(between(quaternion(found.world_from_camera), quaternion(truth.world_from_camera))).toBeLessThan(0.3);
  await expect(page.locator("[data-camera=west]")).toContainText("fits to");

  // The places that snapped are the corners themselves.
  const pairs = ((await draftOf(page))?.draft.calibrating["west"]?.pairs ?? []) as { place_m: Point }[];
  Object.values(PLACES).forEach((place, i) => expect(length(minus(pairs[i]?.place_m ?? [0, 0, 0], place))).toBeLessThan(0.001));

  // A pair that is dragged away is told, by how much and which; undoing brings it back.
  await drag(page, picture(page), await onPane(picture(page), at("eaves")), { x: 30, y: 10 });
  await expect(page.getByText("worst")).toBeVisible();
  await expect.poll(async () => Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeGreaterThan(1.5);
  await expect(async () => {
    await page.keyboard.press("Control+z");
    expect(Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeLessThan(1);
  }).toPass();

  await page.reload();
  await expect(pairRows(page)).toHaveCount(7);
  await expect.poll(async () => Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeLessThan(1);

  expect(await findings(page)).toEqual([]);
});

test("a camera in the hand is carried and pointed, by handles and by keys", async ({ page, url }) => {
  await open(page, url, "&how=torch", true);
  const here = async () => calibrationOf((await draftOf(page))?.draft.scene.document);
  await expect(page.getByLabel("Height (z)")).toHaveValue("5");
  const foot = page.getByRole("button", { name: "Foot of the camera" });
  await foot.focus();
  await foot.press("Shift+ArrowUp");
  await expect.poll(async () => (await here())?.position_m).toEqual([0, -21, 5]);
  await drag(page, page.getByRole("button", { name: "Aim: what" }), { x: 11, y: 11 }, { x: 50, y: 0 });
  await expect.poll(async () => Number(await page.getByLabel("Heading").inputValue())).toBeGreaterThan(3);
  await picture(page).focus();
  await picture(page).press("Shift+e");
  await expect(page.getByRole("textbox", { name: "Roll" })).toHaveValue("2");
  await page.getByRole("textbox", { name: "Field of view" }).fill("75");
  await expect.poll(async () => (await here())?.focal_px[0]).toBeCloseTo(320 / Math.tan((37.5 * Math.PI) / 180), 6);
  await page.reload();
  await expect(page.getByRole("textbox", { name: "Field of view" })).toHaveValue("75");
});

test("lines along buildings and bands, and two pairs, place a camera", async ({ page, url }) => {
  test.slow();
  const truth = await open(page, url, "", true);
  for (const name of ["hall", "right"] as const) {
    await typePlace(page, PLACES[name]);
    await clickPicture(picture(page), pixel(truth, PLACES[name]));
  }
  await page.getByText("Building lines", { exact: true }).click();
  const lines: Record<string, readonly (readonly [Point, Point])[]> = {
    "x, east": [[[-8, 0, 0], [12, 0, 0]], [[-8, -4, 0], [5, -4, 0]]],
    "y, north": [[[0, -9, 0], [0, 14, 0]], [[8, -3, 0], [8, 14, 0]]],
    "z, upright": [[[-1, 6.5, 0], [-1, 6.5, 6.4]], [[8.697846, -0.271462, 0], [8.697846, -0.271462, 4]]],
  };
  for (const [name, drawn] of Object.entries(lines)) {
    await page.getByText(name, { exact: true }).first().click();
    for (const [a, b] of drawn) {
      const [from, to] = [await onPane(picture(page), pixel(truth, a)), await onPane(picture(page), pixel(truth, b))];
      await drag(page, picture(page), from, { x: to.x - from.x, y: to.y - from.y });
    }
  }
  await expect(page.getByText(/The lines meet to/)).toBeVisible();
  await expect(page.getByText("Where it stands is still open")).toBeHidden();
  await page.getByRole("button", { name: "Take over" }).click();
  await expect.poll(async () => calibrationOf((await draftOf(page))?.draft.scene.document)).toBeDefined();
  const found = calibrationOf((await draftOf(page))?.draft.scene.document) ?? truth;
  expect(between(quaternion(found.world_from_camera), quaternion(truth.world_from_camera))).toBeLessThan(1);
  expect(length(minus(point(found.position_m), point(truth.position_m)))).toBeLessThan(1);
});

test("another program's calibration is read, shown and taken over", async ({ page, url, complaints }) => {
  const truth = await open(page, url, "&how=import", true);
  await page.getByLabel("or its text").fill("K: [[500, 0, 320], [0, 500, 180], [0, 0, 1]]\nhello\n");
  await page.getByRole("button", { name: "Read" }).click();
  await expect(page.locator(".cal-refused")).toBeVisible();
  // The browser tells of the refusal.
  expect(complaints.filter((text) => !text.includes("400"))).toEqual([]);
  complaints.length = 0;
  await page.getByLabel("or its text").fill(JSON.stringify(truth));
  await page.getByRole("button", { name: "Read" }).click();
  await expect(page.getByText("640 × 360")).toBeVisible();
  await expect.poll(async () => calibrationOf((await draftOf(page))?.draft.scene.document)).toBeUndefined();
  await page.getByRole("button", { name: "Take over" }).click();
  await expect.poll(async () => calibrationOf((await draftOf(page))?.draft.scene.document)?.position_m).toEqual(truth.position_m);
});

/** By how many pixels patches of one picture are found beside their place in the other: those that have corners, and are found. */
async function shifts(page: Page, pictures: readonly Buffer[]): Promise<number[]> {
  return page.evaluate(async (encoded) => {
    const read = async (base64: string) => {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
      if (!context) throw new Error("no canvas");
      context.drawImage(bitmap, 0, 0);
      const { data, width, height } = context.getImageData(0, 0, bitmap.width, bitmap.height);
      const light = Float32Array.from({ length: width * height }, (_, i) => (data[4 * i] ?? 0) + 2 * (data[4 * i + 1] ?? 0) + (data[4 * i + 2] ?? 0));
      return { width, height, at: (x: number, y: number) => light[y * width + x] ?? 0 };
    };
    const [a, b] = await Promise.all(encoded.map(read));
    if (!a || !b) throw new Error("two pictures");
    const [HALF, REACH] = [12, 5];
    const likeness = (x: number, y: number, dx: number, dy: number) => {
      let [sa, sb, aa, bb, ab, n] = [0, 0, 0, 0, 0, 0];
      for (let v = -HALF; v <= HALF; v += 1) {
        for (let u = -HALF; u <= HALF; u += 1) {
          const [p, q] = [a.at(x + u, y + v), b.at(x + u + dx, y + v + dy)];
          [sa, sb, aa, bb, ab, n] = [sa + p, sb + q, aa + p * p, bb + q * q, ab + p * q, n + 1];
        }
      }
      return (ab - (sa * sb) / n) / Math.sqrt(Math.max((aa - (sa * sa) / n) * (bb - (sb * sb) / n), 1e-9));
    };
    // Corners alone tell of both directions: the smaller eigenvalue of the slopes' moments.
    const corner = (x: number, y: number) => {
      let [xx, yy, xy] = [0, 0, 0];
      for (let v = -HALF; v <= HALF; v += 1) {
        for (let u = -HALF; u <= HALF; u += 1) {
          const [gx, gy] = [a.at(x + u + 1, y + v) - a.at(x + u - 1, y + v), a.at(x + u, y + v + 1) - a.at(x + u, y + v - 1)];
          [xx, yy, xy] = [xx + gx * gx, yy + gy * gy, xy + gx * gy];
        }
      }
      return (xx + yy) / 2 - Math.hypot((xx - yy) / 2, xy);
    };
    const places: { x: number; y: number; score: number }[] = [];
    const edge = HALF + REACH + 1;
    for (let y = edge; y < a.height - edge; y += 20) {
      for (let x = edge; x < a.width - edge; x += 20) places.push({ x, y, score: corner(x, y) });
    }
    places.sort((p, q) => q.score - p.score);
    return places.slice(0, 40).flatMap(({ x, y }) => {
      let best = { likeness: -1, away: Infinity };
      for (let dy = -REACH; dy <= REACH; dy += 1) {
        for (let dx = -REACH; dx <= REACH; dx += 1) {
          const like = likeness(x, y, dx, dy);
          if (like > best.likeness) best = { likeness: like, away: Math.hypot(dx, dy) };
        }
      }
      return best.likeness > 0.85 ? [best.away] : [];
    });
  }, pictures.map((buffer) => buffer.toString("base64")));
}

test("what the browser projects lies where the daemon draws it", async ({ page, url }) => {
  await open(page, url, "&how=import", false);
  await page.getByLabel("Others too").check();
  const canvas = scenePane(page).locator("canvas");
  const box = await canvas.boundingBox();
  const view = JSON.parse((await scenePane(page).locator("..").getAttribute("data-view")) ?? "") as View;
  // What lies over the picture is no part of it.
  await page.evaluate(() => document.querySelectorAll<SVGElement>(".is-scene .cal-overlay").forEach((over) => (over.style.visibility = "hidden")));
  const asked = new URLSearchParams({
    eye: view.eye.join(","), target: view.target.join(","), fov: String(view.fov), width: String(Math.round(box?.width ?? 0)), height: String(Math.round(box?.height ?? 0)),
    entities: "none", see_through: "off",
  });
  const drawn = await page.request.get(`${url}/api/v1/scenes/plaza/view.png?${asked.toString()}`);
  expect(drawn.ok()).toBe(true);
  const theirs = await drawn.body();
  // Pictures of the other cameras come one after another.
  await expect(async () => {
    const found = await shifts(page, [await canvas.screenshot(), theirs]);
    expect(found.length).toBeGreaterThan(25);
    expect(Math.max(...found)).toBeLessThanOrEqual(2);
  }).toPass();
});
