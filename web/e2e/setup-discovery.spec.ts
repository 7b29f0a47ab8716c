// Set-up finds a camera that speaks ONVIF: asked by its address it tells its clock, with a login by name its streams, and one is taken over.

import { type Server, createServer } from "node:http";
import type { AddressInfo } from "node:net";
import { type Daemon, daemon } from "./daemon";
import { expect, test } from "./page";

const AHEAD_MILLIS = 37_000;

let own: Daemon;
let camera: Server;
let address = "";

function time(): string {
  const now = new Date(Date.now() + AHEAD_MILLIS);
  const tag = (name: string, value: number) => `<${name}>${value}</${name}>`;
  const clock = tag("Hour", now.getUTCHours()) + tag("Minute", now.getUTCMinutes()) + tag("Second", now.getUTCSeconds());
  const day = tag("Year", now.getUTCFullYear()) + tag("Month", now.getUTCMonth() + 1) + tag("Day", now.getUTCDate());
  return `<SystemDateAndTime><UTCDateTime><Time>${clock}</Time><Date>${day}</Date></UTCDateTime></SystemDateAndTime>`;
}

/** What the camera answers; null for what it does not know. */
function answer(operation: string): string | null {
  switch (operation) {
    case "GetSystemDateAndTime":
      return time();
    case "GetDeviceInformation":
      return "<Manufacturer>Cameras</Manufacturer><Model>XN-7</Model>";
    case "GetServices":
      return `<Service><Namespace>http://www.onvif.org/ver10/media/wsdl</Namespace><XAddr>http://${address}/media</XAddr></Service>`;
    case "GetProfiles":
      return "<Profiles token='1'><Name>main</Name><VideoEncoderConfiguration><Encoding>H264</Encoding></VideoEncoderConfiguration></Profiles>";
    case "GetStreamUri":
      return "<MediaUri><Uri>rtsp://192.168.0.100:9/live</Uri></MediaUri>";
    default:
      return null;
  }
}

test.beforeAll(async () => {
  camera = createServer((request, response) => {
    let asked = "";
    request.on("data", (part: Buffer) => (asked += part.toString()));
    request.on("end", () => {
      const operation = /<s:Body><q:(\w+)/.exec(asked)?.[1] ?? "";
      const isKnown = operation === "GetSystemDateAndTime" || asked.includes("<o:Username>guard<");
      const told = isKnown ? answer(operation) : null;
      const fault = `<Fault><Code><Value>${isKnown ? "ActionNotSupported" : "NotAuthorized"}</Value></Code></Fault>`;
      const body = told === null ? fault : `<${operation}Response>${told}</${operation}Response>`;
      response.writeHead(told === null ? 400 : 200, { "Content-Type": "application/soap+xml" });
      response.end(`<Envelope><Body>${body}</Body></Envelope>`);
    });
  });
  await new Promise<void>((ready) => camera.listen(0, "127.0.0.1", () => ready()));
  address = `127.0.0.1:${(camera.address() as AddressInfo).port}`;
  const config = '[[credentials]]\nid = "gates"\nuser = "guard"\npassword_env = "PATH"\nnetworks = ["127.0.0.0/8"]\n';
  own = await daemon("setup-discovery", { config });
});
test.afterAll(async () => {
  await own.stop();
  camera.close();
});

test("a camera is asked, and its stream taken over with the name of a login", async ({ page, complaints }) => {
  await page.goto(`${own.url}/#/setup`);
  await page.getByRole("button", { name: "Network camera", exact: true }).click();
  await page.getByLabel("Address of a camera").fill(address);
  await page.getByRole("button", { name: "Ask it" }).click();
  const found = page.getByRole("list", { name: "Cameras that answered" });
  await expect(found).toContainText(/its clock is 3[678]\.\d s ahead/);
  await expect(found).toContainText("or wants one");
  await page.getByLabel("Log in as").selectOption("gates");
  await found.getByRole("button", { name: "Streams" }).click();
  await expect(found).toContainText("it says rtsp://192.168.0.100:9/live");
  await found.getByRole("radio", { name: /main: H264/ }).check();
  await expect(page.getByLabel("Address", { exact: true })).toHaveValue("rtsp://127.0.0.1:9/live");
  await expect(page.getByLabel("Credentials")).toHaveValue("gates");
  await expect(page.getByLabel("Name").last()).toHaveValue("XN-7");
  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByText(/^Kept at/)).toBeVisible();
  const kept = (await (await fetch(`${own.url}/api/v1/cameras/xn-7/document`)).json()) as { source: { credentials: string } };
  expect(kept.source.credentials).toBe("gates");
  // Nobody listens at the stream's port: the browser tells of the look that failed.
  expect(complaints.filter((text) => !text.includes("status of 503"))).toEqual([]);
  complaints.length = 0;
});
