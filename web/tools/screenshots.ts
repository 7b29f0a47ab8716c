// Pictures of every page with the demo's plaza, for docs/images/web: in light and dark, on a phone, and Operate and Wall in 4K.
//
//     npm run screenshots -- http://127.0.0.1:8080 [part of a picture's name]
//
// The daemon is one of `videofields demo` without users. A wall and a named view that are not there are made for it, and taken away
// afterwards; nothing else is changed.

import { mkdirSync, statSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { type Browser, type Page, chromium } from "@playwright/test";

const [url = "http://127.0.0.1:8080", only = ""] = process.argv.slice(2);
const FOLDER = resolve(import.meta.dirname, "../../docs/images/web");
const MOST_BYTES = 250_000;
const QUALITIES = [88, 80, 72, 64, 56, 48, 40, 32];
const PATIENCE_MILLIS = 30_000;
/** What a page that looks ready still loads: small pictures, the timeline, the second round of questions. */
const REST_MILLIS = 2_500;

type Shot = { name: string; address: string; ready: (page: Page) => Promise<unknown>; is4K?: boolean; isFull?: boolean };

const seen = (selector: string) => (page: Page) => page.locator(selector).first().waitFor({ timeout: PATIENCE_MILLIS });
const fused = seen("[role=application][data-time]");
const titled = seen("main h1");
const system = (part: string, ready: Shot["ready"] = titled): Shot => ({ name: `system-${part}`, address: `/#/system?part=${part}`, ready, isFull: true });
const setup = (stage: string): Shot => ({ name: `setup-${stage}`, address: `/#/setup?stage=${stage}&scene=plaza`, ready: titled });

const SHOTS: readonly Shot[] = [
  { name: "operate", address: "/#/operate?scene=plaza", ready: fused, is4K: true },
  { name: "operate-camera", address: "/#/operate?scene=plaza&camera=north", ready: seen(".alone img:not(.is-empty)") },
  setup("videos"), setup("ground"), setup("cameras"), setup("geometry"),
  { name: "walls", address: "/#/wall", ready: seen(".screens") },
  { name: "wall", address: "/#/wall?wall=control-room", ready: seen(".drawing image"), is4K: true },
  { name: "wall-curve", address: "/#/wall?wall=control-curve", ready: seen(".drawing image") },
  { name: "screen", address: "/wall?wall=control-room&tile=r1c2", ready: async (page) => {
    await seen("#screen[data-frame]")(page);
    await page.keyboard.press("h");
  } },
  system("cameras"), system("load", seen(".sparks path")), system("storage"), system("events"), system("users"), system("audit"),
  system("accuracy", seen(".example img")), system("plan", seen("td")),
];

type Look = { suffix: string; width: number; height: number; colorScheme: "light" | "dark"; takes: (shot: Shot) => boolean; isTouch?: boolean };

const LOOKS: readonly Look[] = [
  { suffix: "light", width: 1280, height: 800, colorScheme: "light", takes: () => true },
  { suffix: "dark", width: 1280, height: 800, colorScheme: "dark", takes: () => true },
  { suffix: "phone", width: 390, height: 844, colorScheme: "light", takes: ({ name }) => name !== "screen", isTouch: true },
  { suffix: "4k", width: 3840, height: 2160, colorScheme: "dark", takes: ({ is4K }) => is4K === true },
];

const view = { eye_m: [-6, -19, 7], target_m: [0.5, 1, 0.5] };
const MADE: readonly (readonly [string, object])[] = [
  ["walls/control-room", {
    name: "Control room", scene: "plaza", rate_hz: 5, view, zoom: 0.8,
    surface: { grid: { columns: 3, rows: 2, tile_px: [960, 540], tile_m: [1.21, 0.68], gap_m: [0.01, 0.01] } },
  }],
  ["walls/control-curve", {
    name: "Curved wall", scene: "plaza", rate_hz: 5, view,
    surface: { cylinder: { columns: 5, rows: 1, tile_px: [540, 960], tile_m: [0.68, 1.21], gap_m: [0.01, 0], radius_m: 2.2 } },
  }],
  ["views/square", { name: "The square", scene: "plaza", parameters: "eye=-6,-19,7&target=0.5,1,0.5&fov=45" }],
];

/** Makes what is not there; answers what was made. */
async function make(): Promise<string[]> {
  const made: string[] = [];
  for (const [path, document] of MADE) {
    const answer = await fetch(`${url}/api/v1/${path}`, { method: "PUT", headers: { "If-None-Match": "*" }, body: JSON.stringify(document) });
    if (answer.status === 201) made.push(path);
    else if (answer.status !== 412) throw new Error(`${path}: ${await answer.text()}`);
  }
  return made;
}

async function takeAway(paths: readonly string[]): Promise<void> {
  for (const path of paths) {
    const tag = (await fetch(`${url}/api/v1/${path}`)).headers.get("ETag")?.replace(/-gzip"$/, '"') ?? "";
    await fetch(`${url}/api/v1/${path}`, { method: "DELETE", headers: { "If-Match": tag } });
  }
}

/** A picture of at most so many bytes: as good as fits. */
async function take(page: Page, name: string, isFull: boolean): Promise<number> {
  const file = resolve(FOLDER, `${name}.jpg`);
  let picture: Buffer = Buffer.alloc(0);
  for (const quality of QUALITIES) {
    picture = await page.screenshot({ type: "jpeg", quality, scale: "css", fullPage: isFull, animations: "disabled" });
    if (picture.length <= MOST_BYTES) break;
  }
  writeFileSync(file, picture);
  return statSync(file).size;
}

async function shoot(browser: Browser, look: Look): Promise<void> {
  const { width, height, colorScheme } = look;
  const context = await browser.newContext({ viewport: { width, height }, colorScheme, hasTouch: look.isTouch ?? false, reducedMotion: "reduce" });
  for (const shot of SHOTS.filter((one) => look.takes(one) && `${one.name}-${look.suffix}`.includes(only))) {
    // A page of its own each: nothing of the one before shows or loads on.
    const page = await context.newPage();
    const name = `${shot.name}-${look.suffix}`;
    try {
      await page.goto(`${url}${shot.address}`);
      await shot.ready(page);
      await page.waitForTimeout(REST_MILLIS);
      console.log(`${name}: ${Math.round((await take(page, name, shot.isFull === true && look.suffix !== "phone")) / 1e3)} kB`);
    } catch (error) {
      console.log(`${name}: ${error instanceof Error ? (error.message.split("\n")[0] ?? "") : String(error)}`);
      process.exitCode = 1;
    }
    await page.close();
  }
  await context.close();
}

mkdirSync(FOLDER, { recursive: true });
const made = await make();
const browser = await chromium.launch({
  executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--disable-dev-shm-usage"],
});
try {
  for (const look of LOOKS) await shoot(browser, look);
} finally {
  await browser.close();
  await takeAway(made);
}
