// Calibrating by six pairs, by pointer and by keys, held to the truth; a camera in the hand; and that what the browser projects lies
// where the daemon draws it. Nothing is saved.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import type { Locator, Page } from "@playwright/test";
import type { AxeResults } from "axe-core";
import { type Point, type View, placed } from "../src/operate/orbit";
import type { Calibration, SceneDocument } from "../src/setup/draft";
import { lensOf, project } from "../src/spatial/lens";
import { between, length, minus, point, quaternion } from "../src/setup/cameras/torch";
import { expect, test } from "./page";

const AXE = readFileSync(resolve(import.meta.dirname, "../node_modules/axe-core/axe.min.js"), "utf8");
const KEPT = "videofields.setup";

/** Places that camera west sees: corners of the hall and the cafe, and points of the ground. */
const PLACES = {
  hall: [-1, 6.5, 0], eaves: [-1, 6.5, 6.4], cafe: [8.697846, -0.271462, 0], roof: [14.784607, 1.706247, 4], near: [-10, -4, 0], right: [0, -10, 0],
} satisfies Record<string, Point>;

type Draft = { scene: { document: SceneDocument }; calibrating: Record<string, { pairs: unknown[]; lines: unknown[] }> };

const picture = (page: Page) => page.getByRole("application", { name: "Picture of South-west corner" });
const scene = (page: Page) => page.getByRole("application", { name: "The scene with" });
const draftOf = async (page: Page) =>
  JSON.parse(await page.evaluate((key) => localStorage.getItem(key) ?? "null", KEPT)) as { draft: Draft } | null;
const calibrationOf = (document: SceneDocument | undefined) => document?.cameras?.find(({ id }) => id === "west")?.calibration as Calibration | undefined;

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

/** Where the camera truly shows a place, to the pixel. */
function pixel(truth: Calibration, place: Point): readonly [number, number] {
  const lens = lensOf(truth);
  const at = project(lens, place);
  return [Math.round((at?.u ?? NaN) * lens.size[0]), Math.round((at?.v ?? NaN) * lens.size[1])];
}

/** Where a pixel of the picture lies in its pane. */
async function onPane(pane: Locator, [x, y]: readonly [number, number]): Promise<{ x: number; y: number }> {
  const [scale, left, top] = await Promise.all(["scale", "left", "top"].map(async (name) => Number(await pane.getAttribute(`data-${name}`))));
  return { x: (left ?? 0) + x * (scale ?? 1), y: (top ?? 0) + y * (scale ?? 1) };
}

async function clickPicture(page: Page, at: readonly [number, number]): Promise<void> {
  await picture(page).click({ position: await onPane(picture(page), at) });
}

/** Takes the crosshair from the picture's middle to a pixel, and places it. */
async function keyPicture(page: Page, [x, y]: readonly [number, number]): Promise<void> {
  const pane = picture(page);
  await pane.blur();
  await pane.focus();
  // The first press shows it.
  await pane.press("ArrowRight");
  for (const [by, back, forth] of [[x - 320, "ArrowLeft", "ArrowRight"], [y - 180, "ArrowUp", "ArrowDown"]] as const) {
    const key = by < 0 ? back : forth;
    for (let i = 0; i < Math.floor(Math.abs(by) / 10); i += 1) await pane.press(`Shift+${key}`);
    for (let i = 0; i < Math.abs(by) % 10; i += 1) await pane.press(key);
  }
  await pane.press("Enter");
}

/** Where a place lies in the scene's pane, pixels. */
async function onScene(page: Page, place: Point): Promise<{ x: number; y: number }> {
  const pane = scene(page);
  const view = JSON.parse((await pane.locator("..").getAttribute("data-view")) ?? "") as View;
  const box = await pane.boundingBox();
  const [width, height] = [box?.width ?? 1, box?.height ?? 1];
  // From straight above, north is up.
  const isAbove = view.eye[0] === view.target[0] && view.eye[1] === view.target[1];
  const across = 2 * (view.eye[2] - place[2]) * Math.tan((view.fov * Math.PI) / 360);
  const above = [0.5 + ((place[0] - view.eye[0]) / across) * (height / width), 0.5 - (place[1] - view.eye[1]) / across];
  const [u = 0, v = 0] = isAbove ? above : (placed(view, width / height, place) ?? []);
  return { x: u * width, y: v * height };
}

async function clickScene(page: Page, place: Point): Promise<void> {
  const { x, y } = await onScene(page, place);
  // Not quite to the pixel: it snaps.
  await scene(page).click({ position: { x: x + 2, y: y - 1 } });
}

/** Drags from a place of an element by so many pixels, with nothing that sticks to the page's edges above it. */
async function drag(page: Page, what: Locator, from: { x: number; y: number }, by: { x: number; y: number }): Promise<void> {
  await page.evaluate(() => scrollTo(0, 0));
  const box = await what.boundingBox();
  const [x, y] = [(box?.x ?? 0) + from.x, (box?.y ?? 0) + from.y];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + by.x, y + by.y, { steps: 3 });
  await page.mouse.up();
}

async function typePlace(page: Page, place: Point): Promise<void> {
  const fields = page.getByRole("group", { name: /without clicking/ });
  for (const [i, axis] of ["x", "y", "z"].entries()) await fields.getByLabel(`World ${axis}`).fill(String(place[i]));
  await fields.getByLabel("World z").press("Enter");
}

const rows = (page: Page) => page.getByRole("region", { name: "Pairs" }).getByRole("row");

test("six pairs by pointer and keys place a camera", async ({ page, url }) => {
  test.slow();
  const truth = await open(page, url, "", true);
  const at = (name: keyof typeof PLACES) => pixel(truth, PLACES[name]);

  // Picture first, scene first; a corner of a list; a point of the map; numbers.
  await clickPicture(page, at("hall"));
  await clickScene(page, PLACES.hall);
  await expect(rows(page)).toHaveCount(2);
  await clickScene(page, PLACES.eaves);
  await clickPicture(page, at("eaves"));
  await clickScene(page, PLACES.cafe);
  await keyPicture(page, at("cafe"));
  await expect(rows(page)).toHaveCount(4);
  await expect(page.getByText("3 more pairs and the camera can be found.")).toBeVisible();
  await keyPicture(page, at("roof"));
  await page.getByLabel("Known place").selectOption("upper corner 2 of box cafe");
  await page.getByRole("button", { name: "Take this place" }).last().press("Enter");
  await page.getByText("From above", { exact: true }).click();
  // Closer, points of a finer grid are meant.
  await scene(page).hover({ position: await onScene(page, PLACES.near) });
  await page.mouse.wheel(0, -600);
  await clickScene(page, PLACES.near);
  await clickPicture(page, at("near"));
  await typePlace(page, PLACES.right);
  await clickPicture(page, at("right"));
  await expect(rows(page)).toHaveCount(7);

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
  await expect(rows(page)).toHaveCount(7);
  await expect.poll(async () => Number(await page.locator(".cal-error").getAttribute("data-rms"))).toBeLessThan(1);

  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => (globalThis as unknown as { axe: { run: () => Promise<AxeResults> } }).axe.run());
  expect(violations.filter(({ impact }) => impact === "serious" || impact === "critical").map(({ id, nodes }) => `${id}: ${nodes[0]?.html ?? ""}`)).toEqual([]);
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
    await clickPicture(page, pixel(truth, PLACES[name]));
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
  const canvas = scene(page).locator("canvas");
  const box = await canvas.boundingBox();
  const view = JSON.parse((await scene(page).locator("..").getAttribute("data-view")) ?? "") as View;
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
