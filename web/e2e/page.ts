// What every test needs: the page, and that nothing goes wrong on it unseen.

import { type Page, test as plain } from "@playwright/test";
import { expect } from "@playwright/test";

export { expect };

/** Complaints of the browser that a test expects. */
type Given = { url: string; complaints: string[] };

/** As Playwright's, and fails where the console told of an error or the content security policy was broken. */
export const test = plain.extend<Given>({
  // eslint-disable-next-line no-empty-pattern -- Playwright reads which fixtures one hangs on from here
  url: async ({}, use) => {
    await use(process.env["E2E_URL"] ?? "");
  },
  complaints: [
    async ({ page }, use) => {
      const complaints: string[] = [];
      page.on("console", (message) => {
        if (message.type() === "error") complaints.push(message.text());
      });
      page.on("pageerror", (error) => complaints.push(error.message));
      await use(complaints);
      expect(complaints).toEqual([]);
    },
    { auto: true },
  ],
});

/** For a file whose tests ask so much of the daemon that a busy machine answers 503 now and then, and is asked again. */
export function forgiveBusy(): void {
  test.afterEach(({ complaints }) => {
    complaints.splice(0, complaints.length, ...complaints.filter((text) => !text.includes("503")));
  });
}

/** The fused view, once it shows a picture. */
export async function fused(page: Page) {
  const stage = page.getByRole("application");
  await expect(stage).toHaveAttribute("data-time", /\d+/);
  await expect(stage.locator("img")).toBeVisible();
  return stage;
}

/** The bytes of the picture that is shown, as a number that changes with them. */
export async function digest(page: Page): Promise<string> {
  return page.getByRole("application").locator("img").evaluate((image: HTMLImageElement) => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [64, 36];
    const context = canvas.getContext("2d");
    context?.drawImage(image, 0, 0, 64, 36);
    const pixels = context?.getImageData(0, 0, 64, 36).data ?? new Uint8ClampedArray();
    return Array.from(pixels.filter((_, i) => i % 16 === 0)).join(",");
  });
}

/** How far apart two digests are: mean difference of a code. */
export function apart(a: string, b: string): number {
  const [one, other] = [a, b].map((text) => text.split(",").map(Number));
  return (one ?? []).reduce((sum, code, i) => sum + Math.abs(code - (other?.[i] ?? 0)), 0) / (one?.length ?? 1);
}
