// What the pages weigh and how long the first fused picture takes, measured against a running daemon, as a table.
//
//     npm run figures -- http://127.0.0.1:8080 [runs]
//
// Bytes are those over the wire, headers among them: the page's own files (markup, scripts, styles), and beside them what it asks
// the interface for until it has settled. Every measurement has a browser profile of its own, so nothing is kept from before.

import { type Browser, type Page, chromium } from "@playwright/test";

const [url = "http://127.0.0.1:8080", runs = "5"] = process.argv.slice(2);
const SETTLE_MILLIS = 4_000;
const PATIENCE_MILLIS = 60_000;

const PLACES: readonly (readonly [string, string])[] = [
  ["Operate", "/#/operate"],
  ["Set-up, videos", "/#/setup?stage=videos"],
  ["Set-up, ground", "/#/setup?stage=ground"],
  ["Set-up, cameras", "/#/setup?stage=cameras"],
  ["Set-up, geometry", "/#/setup?stage=geometry"],
  ["Wall", "/#/wall"],
  ["Wall, editor", "/#/wall?new=1"],
  ["System, cameras", "/#/system"],
  ["System, accuracy", "/#/system?part=accuracy"],
];

type Weight = { files: number; fileBytes: number; otherBytes: number };

/** Adds up what comes over the wire from now on. */
async function weigh(page: Page): Promise<Weight> {
  const weight: Weight = { files: 0, fileBytes: 0, otherBytes: 0 };
  const isFile = new Map<string, boolean>();
  const session = await page.context().newCDPSession(page);
  await session.send("Network.enable");
  session.on("Network.responseReceived", ({ requestId, response }) => {
    const { pathname } = new URL(response.url, url);
    isFile.set(requestId, response.url.startsWith("http") && !/^\/(api|metrics|healthz)/.test(pathname));
  });
  session.on("Network.loadingFinished", ({ requestId, encodedDataLength }) => {
    if (isFile.get(requestId)) {
      weight.files += 1;
      weight.fileBytes += encodedDataLength;
    } else weight.otherBytes += encodedDataLength;
  });
  return weight;
}

async function fresh<Result>(browser: Browser, then: (page: Page) => Promise<Result>): Promise<Result> {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const result = await then(await context.newPage());
  await context.close();
  return result;
}

/** Notes in the page when it first shows a fused picture, milliseconds since navigation began; another loading of it is warm. */
async function firstPicture(page: Page): Promise<number> {
  await page.waitForFunction(() => (globalThis as unknown as { firstPicture?: number }).firstPicture !== undefined, undefined, { timeout: PATIENCE_MILLIS });
  return page.evaluate(() => (globalThis as unknown as { firstPicture: number }).firstPicture);
}

async function times(browser: Browser): Promise<{ cold: number; warm: number }> {
  return fresh(browser, async (page) => {
    await page.addInitScript(() => {
      const told = globalThis as unknown as { firstPicture?: number };
      const look = () => {
        const stage = document.querySelector("[role=application][data-time] img[src^='blob:'], [role=application][data-time] canvas");
        if (stage && told.firstPicture === undefined) told.firstPicture = performance.now();
        if (told.firstPicture === undefined) requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
    await page.goto(`${url}/#/operate`);
    const cold = await firstPicture(page);
    await page.reload();
    return { cold, warm: await firstPicture(page) };
  });
}

const median = (values: readonly number[]) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? NaN;
const kib = (bytes: number) => `${(bytes / 1024).toFixed(0)} KiB`;

const browser = await chromium.launch({
  executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--disable-dev-shm-usage"],
});
try {
  console.log("| place | files | their bytes, compressed | asked of the interface, first 4 s |\n| --- | ---: | ---: | ---: |");
  for (const [name, address] of PLACES) {
    const weight = await fresh(browser, async (page) => {
      const found = await weigh(page);
      await page.goto(`${url}${address}`);
      await page.locator("main h1, main h2, main [role=application]").first().waitFor({ timeout: PATIENCE_MILLIS });
      await page.waitForTimeout(SETTLE_MILLIS);
      return { ...found };
    });
    console.log(`| ${name} | ${weight.files} | ${kib(weight.fileBytes)} | ${kib(weight.otherBytes)} |`);
  }
  const all: { cold: number; warm: number }[] = [];
  for (let i = 0; i < Number(runs); i += 1) all.push(await times(browser));
  const [cold, warm] = [all.map((one) => one.cold), all.map((one) => one.warm)];
  console.log("\n| from navigation to the first fused picture | median | least | most |\n| --- | ---: | ---: | ---: |");
  for (const [name, values] of [["nothing kept by the browser", cold], ["loaded again", warm]] as const) {
    console.log(`| ${name} | ${median(values).toFixed(0)} ms | ${Math.min(...values).toFixed(0)} ms | ${Math.max(...values).toFixed(0)} ms |`);
  }
} finally {
  await browser.close();
}
