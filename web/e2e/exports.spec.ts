// A clip of what was recorded: asked for in Operate, made by a daemon that records, and fetched.

import { type Daemon, daemon } from "./daemon";
import { expect, forgiveBusy, fused, test } from "./page";

let recording: Daemon;
/** What a Matroska file begins with. */
const EBML = "1a45dfa3";
const LEAST_SECS = 12;

test.beforeAll(async () => {
  recording = await daemon("recording", { records: true });
});
test.afterAll(async () => {
  await recording.stop();
});
forgiveBusy();

test("a clip is chosen, made while its progress is told, fetched and removed", async ({ page, request }) => {
  test.setTimeout(120_000);
  const { url } = recording;
  const recorded = async () => {
    const { cameras } = (await (await request.get(`${url}/api/v1/cameras`)).json()) as { cameras: { recording: { segments?: number; first?: string } | null }[] };
    return cameras.filter((camera) => camera.recording !== null).length;
  };
  await expect.poll(recorded, { timeout: 60_000 }).toBe(3);
  await page.goto(`${url}/#/operate?side=keep`);
  await fused(page);
  await page.waitForTimeout(LEAST_SECS * 1_000);
  const clips = page.getByRole("region", { name: "Clips" });
  await clips.getByRole("button", { name: "Export a clip" }).click();
  // What is typed must be a time, and the end after the beginning.
  const ends = clips.getByLabel("Ends");
  const end = await ends.inputValue();
  await ends.fill("noon or so");
  await ends.press("Enter");
  await expect(clips.getByRole("alert")).toHaveText("It must be a time, and the end after the beginning.");
  await ends.fill(end);
  await ends.press("Enter");
  await expect(clips.getByRole("alert")).toHaveCount(0);
  await clips.getByRole("checkbox", { name: "South-east corner" }).uncheck();
  await clips.getByLabel("Note").fill("Somebody at the gate");
  await clips.getByRole("button", { name: "Export", exact: true }).click();

  const row = clips.getByRole("listitem").filter({ hasText: "Somebody at the gate" }).first();
  await expect(row).toContainText("North side");
  await expect(row).not.toContainText("South-east corner");
  await expect(row).toHaveAttribute("data-state", "done", { timeout: 60_000 });
  const links = await row.getByRole("link").evaluateAll((all: HTMLAnchorElement[]) => all.map(({ href }) => href));
  const videos = links.filter((link) => link.endsWith(".mkv"));
  expect(videos).toHaveLength(2);
  for (const link of videos) {
    const file = await request.get(link);
    expect(file.status()).toBe(200);
    const bytes = await file.body();
    expect(bytes.subarray(0, 4).toString("hex")).toBe(EBML);
    expect(bytes.length).toBeGreaterThan(10_000);
  }
  await row.getByRole("button", { name: "Remove", exact: true }).click();
  await row.getByRole("button", { name: "Remove it" }).click();
  await expect(row).toHaveCount(0);
  expect((await request.get(videos[0] ?? "")).status()).toBe(404);
});
