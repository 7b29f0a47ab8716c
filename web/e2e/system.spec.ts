// System: an admin makes a viewer of one camera, who sees only that, everywhere; what was done is in the audit log; what exactness
// costs is drawn. One daemon of its own for what changes users.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import type { Page, Response } from "@playwright/test";
import { type Daemon, daemon } from "./daemon";
import { expect, test } from "./page";

const PASSWORD = "a long password";
const REPORT = resolve(import.meta.dirname, "../../docs/accuracy/plaza/report.json");
/** Of the cameras that the viewer may not see: names, and ids where a document has them. */
const FORBIDDEN_TEXT = /South-(east|west)/;
const FORBIDDEN_DATA = /South-(east|west)|"(east|west)"|cameras\/(east|west)|\b(east|west)=\d{4}-/;
const ADDRESSES = [
  "operate", "operate?camera=north", "operate?view=map", "setup", "setup?stage=videos", "setup?stage=ground", "setup?stage=cameras", "setup?stage=geometry",
  "wall", "wall?wall=control", ...["cameras", "load", "storage", "events", "users", "audit", "accuracy", "plan"].map((part) => `system?part=${part}`),
];

async function logIn(page: Page, user: string): Promise<void> {
  const dialog = page.getByRole("dialog", { name: "Log in" });
  await dialog.getByLabel("Name").fill(user);
  await dialog.getByLabel("Password").fill(PASSWORD);
  await dialog.getByRole("button", { name: "Log in" }).click();
  await expect(page.getByRole("button", { name: `Log out ${user}` })).toBeVisible();
}

test.describe("users", () => {
  test.describe.configure({ mode: "serial" });
  let own: Daemon;
  test.beforeAll(async () => {
    own = await daemon("system");
  });
  test.afterAll(async () => {
    await own.stop();
  });

  test("an admin makes users and tokens, and the last admin stays", async ({ page, complaints }) => {
    test.setTimeout(120_000);
    await page.goto(`${own.url}/#/system?part=users`);
    await page.getByRole("button", { name: "New user" }).click();
    await page.getByLabel("Name (a to z").fill("ann");
    await page.getByLabel("Password").fill("too short");
    await expect(page.getByRole("button", { name: "Make user" })).toBeDisabled();
    await page.getByLabel("Password").fill(PASSWORD);
    await page.getByRole("button", { name: "Make user" }).click();
    await logIn(page, "ann");

    await page.getByRole("button", { name: "New user" }).click();
    await page.getByLabel("Name (a to z").fill("guest");
    await page.getByLabel("Password").fill(PASSWORD);
    await page.getByRole("checkbox", { name: "live of North side" }).check();
    await page.getByRole("button", { name: "Make user" }).click();
    await expect(page.getByText("guest is made.")).toBeVisible();
    await expect(page.getByRole("row", { name: /guest viewer North side: live/ })).toBeVisible();
    // What is given of all cameras is given of each; taken back before it is saved.
    await page.getByRole("button", { name: "Change guest" }).click();
    await page.getByRole("checkbox", { name: "history of All cameras" }).check();
    await expect(page.getByRole("checkbox", { name: "history of North side" })).toBeDisabled();
    await page.getByRole("checkbox", { name: "history of All cameras" }).uncheck();
    await page.getByRole("button", { name: "Save" }).click();
    await expect(page.getByText("guest is changed.")).toBeVisible();

    await page.getByRole("button", { name: "Remove ann" }).click();
    await page.getByRole("button", { name: "Remove", exact: true }).first().click();
    await expect(page.getByRole("alert").filter({ hasText: /admin/ })).toBeVisible();

    const form = page.getByRole("form", { name: "New token" });
    await form.getByRole("combobox").selectOption("guest");
    await form.getByLabel("For").fill("lobby");
    await form.getByRole("button", { name: "Make token" }).click();
    await expect(page.getByRole("textbox", { name: "Token" })).toHaveValue(/^vf_/);
    const secret = await page.getByRole("textbox", { name: "Token" }).inputValue();
    const asGuest = { Authorization: `Bearer ${secret}` };
    expect((await page.request.get(`${own.url}/api/v1/cameras/west`, { headers: asGuest })).status()).toBe(404);
    await page.getByRole("button", { name: "Done" }).click();
    await expect(page.getByText(secret)).toHaveCount(0);
    await page.getByRole("button", { name: "Revoke the token of guest for lobby" }).click();
    await page.getByRole("button", { name: "Revoke", exact: true }).click();
    await expect(page.getByText("There are no tokens.")).toBeVisible();

    // A screen without a keyboard gets a link.
    const grid = { columns: 1, rows: 1, tile_px: [160, 90], tile_m: [0.4, 0.225] };
    const wall = { name: "Control", scene: "plaza", rate_hz: 2, view: { eye_m: [0, -14, 5], target_m: [0, 2, 1] }, surface: { grid } };
    const { csrf_token: proof } = (await (await page.request.get(`${own.url}/api/v1/session`)).json()) as { csrf_token: string };
    const kept = await page.request.put(`${own.url}/api/v1/walls/control`, { data: wall, headers: { "X-CSRF-Token": proof, "If-None-Match": "*" } });
    expect(kept.status(), await kept.text()).toBe(201);
    await page.goto(`${own.url}/#/wall?wall=control`);
    await page.getByRole("combobox", { name: "Shown as" }).selectOption("guest");
    await page.getByRole("button", { name: "Link with a token for r1c1" }).click();
    await expect(page.getByRole("textbox", { name: "Link for r1c1" })).toHaveValue(new RegExp(`^${own.url}/wall\\?wall=control&tile=r1c1#token=vf_`));

    // All of it is in the log, the newest first.
    await page.goto(`${own.url}/#/system?part=audit`);
    await page.getByRole("searchbox", { name: "What" }).fill("users/guest");
    const rows = page.getByRole("region", { name: "Audit" }).getByRole("row");
    await expect(rows.nth(1)).toHaveAccessibleName(/ann PUT \/api\/v1\/users\/\{id\} \/api\/v1\/users\/guest 200/);
    await expect(rows.nth(2)).toHaveAccessibleName(/ann PUT \/api\/v1\/users\/\{id\} \/api\/v1\/users\/guest 201/);
    await page.getByRole("searchbox", { name: "What" }).fill("users/ann");
    await page.getByLabel("only what was refused").check();
    await expect(rows.nth(1)).toHaveAccessibleName(/ann DELETE .* 409/);
    // The browser tells of what was refused.
    expect(complaints.filter((text) => !/40[149]/.test(text))).toEqual([]);
    complaints.length = 0;
  });

  test("a viewer of one camera sees only that, everywhere", async ({ page, complaints }) => {
    test.setTimeout(240_000);
    const leaks: string[] = [];
    const told: Promise<unknown>[] = [];
    const look = async (response: Response) => {
      const { pathname, search } = new URL(response.url());
      const type = response.headers()["content-type"] ?? "";
      const fields = JSON.stringify(response.headers());
      if (FORBIDDEN_DATA.test(fields)) leaks.push(`${pathname}: ${fields}`);
      if (!/^\/(api|metrics)/.test(pathname) || !/json|text\/plain/.test(type)) return;
      const body = await response.text().catch(() => "");
      if (FORBIDDEN_DATA.test(body)) leaks.push(`${pathname}${search}: ${body.slice(0, 300)}`);
    };
    page.on("response", (response) => told.push(look(response)));
    page.on("websocket", (socket) => /cameras\/(east|west)/.test(socket.url()) && leaks.push(socket.url()));
    await page.goto(`${own.url}/#/operate`);
    await logIn(page, "guest");
    await expect(page.getByRole("application").first()).toHaveAttribute("data-time", /\d+/, { timeout: 60_000 });
    for (const address of ADDRESSES) {
      await page.goto(`${own.url}/#/${address}`);
      await expect(page.locator("main h1, main h2, main [role=application]").first()).toBeVisible();
      await expect(page.getByText("Loading …"), address).toHaveCount(0, { timeout: 40_000 });
      expect(await page.locator("body").innerText(), address).not.toMatch(FORBIDDEN_TEXT);
      expect(await page.locator("main").innerHTML(), address).not.toMatch(FORBIDDEN_TEXT);
    }
    await page.goto(`${own.url}/#/system`);
    await expect(page.getByRole("region", { name: "Cameras" }).getByRole("row")).toHaveCount(2);
    await expect(page.getByRole("link", { name: "Users" })).toHaveCount(0);
    await expect(page.getByRole("link", { name: "Audit" })).toHaveCount(0);
    await page.goto(`${own.url}/#/system?part=load`);
    await expect(page.getByText("These numbers are for who may see all cameras live.")).toBeVisible();
    await page.goto(`${own.url}/#/wall?wall=control`);
    await expect(page.getByRole("button", { name: "Keep", exact: true })).toHaveCount(0);
    await Promise.all(told);
    expect(leaks).toEqual([]);
    // The browser tells of what is not open to them, and of pictures that a busy machine refuses.
    expect(complaints.filter((text) => !/40[134]|503/.test(text))).toEqual([]);
    complaints.length = 0;
  });
});

type Row = { knob: string; value: string; time_ms: { median: number } };
type Report = { machine: object; measured_at: string; took_secs: number; stages: { rows: Row[] }[] };

test("accuracy is drawn, from fast to exact", async ({ page, url }) => {
  const report = JSON.parse(readFileSync(REPORT, "utf8")) as Report;
  const table = {
    version: 1, machine: report.machine, subject: "world plaza", measured_at: report.measured_at, took_secs: report.took_secs, is_complete: true,
    rows: report.stages.flatMap(({ rows }) => rows),
  };
  // A time that the test chooses: it has to hold whatever the report's machine measured.
  const oneSample = table.rows.find(({ knob, value }) => knob === "samples" && value === "1");
  if (oneSample) oneSample.time_ms.median = 12.34;
  let state = "measured";
  await page.route("**/api/v1/accuracy", async (route) => {
    if (route.request().method() === "POST") state = "measuring";
    await route.fulfill({ status: route.request().method() === "POST" ? 202 : 200, json: { state, reason: null, table } });
  });
  await page.goto(`${url}/#/system?part=accuracy`);
  for (const name of ["Finding what moves", "Placing texels in the world", "Drawing what stands still", "Drawing people and things that move", "All of it together"]) {
    const chart = page.getByRole("img", { name: `${name}: error against time` });
    await expect(chart).toBeVisible();
    expect(await chart.locator("circle").count()).toBeGreaterThan(4);
  }
  const still = page.getByRole("region", { name: "Drawing what stands still", exact: true });
  // Long tables are closed at first.
  await still.getByText("As a table").click();
  await expect(still.getByRole("row", { name: "samples 1 12.3" })).toBeVisible();
  // The slider says what is expected, and shows it beside the exact picture.
  const slider = page.getByRole("slider", { name: "Setting" });
  await slider.focus();
  await page.keyboard.press("Home");
  await expect(slider).toHaveAttribute("aria-valuetext", "roughest");
  await expect(page.getByText(/Expected: \d+ ms/)).toBeVisible();
  await expect(page.getByRole("img", { name: "roughest" })).toBeVisible();
  await expect(page.getByRole("img", { name: "exact", exact: true })).toBeVisible();
  await expect(page.getByText(/took \d+ ms differs from exact by [1-9]\d*\.\d codes/)).toBeVisible();
  await page.keyboard.press("End");
  await expect(slider).toHaveAttribute("aria-valuetext", "exact");
  await expect(page.getByText(/differs from exact by 0\.0 codes/)).toBeVisible();
  await page.getByRole("button", { name: "Measure now" }).click();
  await expect(page.getByRole("progressbar", { name: "Measuring" })).toBeVisible();
  await expect(page.getByText("No pictures while it is being measured.")).toBeVisible();
  await expect(page.getByRole("button", { name: "Measure now" })).toBeDisabled();
});

test("load, storage, events and the plan tell of the daemon", async ({ page, url }) => {
  await page.goto(`${url}/#/system?part=load`);
  await expect(page.getByRole("img", { name: /^Requests: [\d.]+ a second now/ })).toBeVisible();
  await expect(page.getByRole("region", { name: "Cameras' work" }).getByRole("row")).toHaveCount(4);
  await page.getByRole("link", { name: "Storage" }).click();
  await expect(page.getByRole("region", { name: "What can be shown of each camera" }).getByRole("row")).toHaveCount(4);
  await page.getByRole("link", { name: "Events" }).click();
  await page.getByRole("combobox", { name: "Camera" }).selectOption("north");
  await expect(page).toHaveURL(/part=events.*camera=north/);
  await page.reload();
  await expect(page.getByRole("combobox", { name: "Camera" })).toHaveValue("north");
  await page.getByRole("link", { name: "Plan" }).click();
  await page.getByRole("button", { name: "Draw it once" }).click();
  await expect(page.getByText(/drawing took \d+ ms|It was drawn before/)).toBeVisible();
});
