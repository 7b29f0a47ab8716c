// What tests of calibrating share: where a camera truly shows a place, and how a place is clicked in picture and scene.

import type { Locator, Page } from "@playwright/test";
import { type Point, type View, placed } from "../src/operate/orbit";
import type { Calibration, SceneDocument } from "../src/setup/draft";
import { lensOf, project } from "../src/spatial/lens";

/** Where a camera truly shows a place, to the pixel. */
export function pixel(truth: Calibration, place: Point): readonly [number, number] {
  const lens = lensOf(truth);
  const at = project(lens, place);
  if (!at) throw new Error("the camera does not see the place");
  return [Math.round(at.u * lens.size[0]), Math.round(at.v * lens.size[1])];
}

/** The calibration of a camera in a scene's document. */
export function calibrationIn(document: SceneDocument | undefined, camera: string): Calibration | undefined {
  return document?.cameras?.find(({ id }) => id === camera)?.calibration as Calibration | undefined;
}

/** The pane of a camera's picture, and of the scene, in Set-up's stage Cameras. */
export const picturePane = (page: Page, name: string) => page.getByRole("application", { name: `Picture of ${name}` });
export const scenePane = (page: Page) => page.getByRole("application", { name: "The scene with" });

/** Where a pixel of the picture lies in its pane. */
export async function onPane(pane: Locator, [x, y]: readonly [number, number]): Promise<{ x: number; y: number }> {
  const [scale, left, top] = await Promise.all(["scale", "left", "top"].map(async (name) => Number(await pane.getAttribute(`data-${name}`))));
  return { x: (left ?? 0) + x * (scale ?? 1), y: (top ?? 0) + y * (scale ?? 1) };
}

export async function clickPicture(pane: Locator, at: readonly [number, number]): Promise<void> {
  await pane.click({ position: await onPane(pane, at) });
}

/** Takes the crosshair from the picture's middle to a pixel, and places it. */
export async function keyPicture(pane: Locator, [x, y]: readonly [number, number]): Promise<void> {
  // Where it was left before it stays; so it begins in the middle.
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
export async function onScene(pane: Locator, place: Point): Promise<{ x: number; y: number }> {
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

export async function clickScene(pane: Locator, place: Point): Promise<void> {
  const { x, y } = await onScene(pane, place);
  // Not quite to the pixel: it snaps.
  await pane.click({ position: { x: x + 2, y: y - 1 } });
}

/** Drags from a place of an element by so many pixels, with nothing that sticks to the page's edges above it. */
export async function drag(page: Page, what: Locator, from: { x: number; y: number }, by: { x: number; y: number }): Promise<void> {
  await page.evaluate(() => scrollTo(0, 0));
  const box = await what.boundingBox();
  const [x, y] = [(box?.x ?? 0) + from.x, (box?.y ?? 0) + from.y];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + by.x, y + by.y, { steps: 3 });
  await page.mouse.up();
}

export async function typePlace(page: Page, place: Point): Promise<void> {
  const fields = page.getByRole("group", { name: /without clicking/ });
  for (const [i, axis] of ["x", "y", "z"].entries()) await fields.getByLabel(`World ${axis}`).fill(String(place[i]));
  await fields.getByLabel("World z").press("Enter");
}

/** The table of pairs, one row of which names the columns. */
export const pairRows = (page: Page) => page.getByRole("region", { name: "Pairs" }).getByRole("row");
