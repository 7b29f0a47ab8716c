// Where there are users: log-in, what a viewer of one camera sees, and a daemon that goes away and comes back. One daemon of its
// own for all of it, since starting one takes seconds.

import { type Daemon, daemon } from "./daemon";
import { expect, fused, test } from "./page";

test.describe.configure({ mode: "serial" });

const PASSWORD = "a long password";
let own: Daemon;

test.beforeAll(async () => {
  own = await daemon("own");
});
test.afterAll(async () => {
  await own.stop();
});

test("a lost daemon is told, and the page goes on by itself where it was", async ({ page, complaints }) => {
  await page.goto(`${own.url}/#/operate?eye=12,-20,9&target=0,0,0&fov=50`);
  const stage = await fused(page);
  await own.stop();
  await expect(page.getByRole("alert")).toContainText("No answer from the daemon");
  await expect(stage).toHaveClass(/is-old/);
  await expect(page.locator(".camera[data-state=unknown]")).toHaveCount(3);
  const last = Number(await stage.getAttribute("data-time"));
  await own.start();
  await expect(page.getByRole("alert")).not.toContainText("No answer");
  await expect.poll(async () => Number(await stage.getAttribute("data-time"))).toBeGreaterThan(last);
  await expect(stage).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await expect(page.locator(".camera[data-state=live]")).toHaveCount(3);
  // The browser tells of every refused connection, and of what a daemon that ends does not answer any more.
  expect(complaints.filter((text) => !/net::ERR_|503/.test(text))).toEqual([]);
  complaints.length = 0;
});

test("who looks logs in, and sees what is theirs", async ({ page, request, complaints }) => {
  const put = async (user: string, data: object, headers: Record<string, string> = {}) => {
    const answer = await request.put(`${own.url}/api/v1/users/${user}`, { data, headers: { "If-None-Match": "*", ...headers } });
    expect(answer.status()).toBe(201);
  };
  await put("ann", { role: "admin", password: PASSWORD });
  const logged = await request.post(`${own.url}/api/v1/session`, { data: { user: "ann", password: PASSWORD } });
  const { csrf_token: proof } = (await logged.json()) as { csrf_token: string };
  await put("guest", { role: "viewer", password: PASSWORD, cameras: { north: ["live"] } }, { "X-CSRF-Token": proof });

  await page.goto(`${own.url}/#/operate?eye=12,-20,9&target=0,0,0&fov=50`);
  const dialog = page.getByRole("dialog", { name: "Log in" });
  await dialog.getByLabel("Name").fill("guest");
  await dialog.getByLabel("Password").fill("not the password");
  await dialog.getByRole("button", { name: "Log in" }).click();
  await expect(dialog.getByRole("alert")).not.toBeEmpty();
  // The browser tells of the refusal.
  expect(complaints.filter((text) => !text.includes("401"))).toEqual([]);
  complaints.length = 0;
  await dialog.getByLabel("Password").fill(PASSWORD);
  await dialog.getByRole("button", { name: "Log in" }).click();
  await expect(page.getByRole("button", { name: "Log out guest" })).toBeVisible();
  const stage = await fused(page);
  await expect(stage).toHaveAttribute("data-view", /"eye":\[12,-20,9\]/);
  await expect(page.locator(".camera")).toHaveCount(1);
  await expect(page.locator(".camera")).toContainText("North side");
  await expect(page.getByText("The past is not open to you.")).toBeVisible();
  await expect(stage).toContainText("Without cameras that you may not see");
  await page.getByRole("link", { name: "System" }).click();
  await expect(page.getByRole("region", { name: "Cameras" }).getByRole("row")).toHaveCount(2);
  await expect(page.getByRole("heading", { name: "Users" })).toHaveCount(0);
  const text = await page.locator("body").innerText();
  expect(text).not.toMatch(/south|\bwest\b|\beast\b/i);
  complaints.length = 0;
  await page.getByRole("button", { name: "Log out guest" }).click();
  await expect(dialog).toBeVisible();

  // A screen that nobody stands before is let in by its token, which leaves the address at once.
  const admin = { "X-CSRF-Token": proof };
  const grid = { columns: 1, rows: 1, tile_px: [160, 90], tile_m: [0.4, 0.225] };
  const wall = { scene: "plaza", rate_hz: 2, view: { eye_m: [0, -14, 5], target_m: [0, 2, 1] }, surface: { grid } };
  const kept = await request.put(`${own.url}/api/v1/walls/control`, { data: wall, headers: { ...admin, "If-None-Match": "*" } });
  expect(kept.status(), await kept.text()).toBe(201);
  const made = await request.post(`${own.url}/api/v1/tokens`, { data: { user: "guest" }, headers: admin });
  const { token } = (await made.json()) as { token: string };
  await page.goto(`${own.url}/wall?wall=control&tile=r1c1#token=${token}`);
  await expect(page).toHaveURL(`${own.url}/wall?wall=control&tile=r1c1`);
  await expect(page.locator("#screen")).toHaveAttribute("data-frame", /\d+/);
  await expect(page.locator("#state")).toBeHidden();
  complaints.length = 0;
});
