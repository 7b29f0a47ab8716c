// The pages in Debian's Chromium without a screen or a graphics card, against the daemon itself with its demo.

import { defineConfig } from "@playwright/test";

export default defineConfig({
  testDir: "e2e",
  outputDir: "../target/web-e2e",
  globalSetup: "./e2e/daemon.ts",
  // One machine draws for the daemon and the browser: one test at a time.
  workers: 1,
  // A machine that others use too may be slow once; what needs the second try is told as flaky.
  retries: process.env["CI"] ? 1 : 0,
  timeout: 60_000,
  expect: { timeout: 20_000 },
  reporter: "line",
  use: {
    screenshot: "only-on-failure",
    viewport: { width: 1280, height: 800 },
    launchOptions: {
      executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
      args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--disable-dev-shm-usage"],
    },
  },
});
