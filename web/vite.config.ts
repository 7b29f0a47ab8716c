// How the pages are built: two of them, no script or style within the text (the daemon's content security policy), and every file
// but the pages themselves and the icon under a name with its digest.

import { defineConfig } from "vitest/config";

// A daemon to ask while the pages are worked on with `npm run dev`.
const daemon = process.env["VIDEOFIELDS_URL"] ?? "http://127.0.0.1:8080";

export default defineConfig({
  build: {
    target: "es2022",
    // The folder holds what keeps it in the history; package.json removes the files with digests before.
    emptyOutDir: false,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rolldownOptions: { input: { main: "index.html", wall: "wall.html" } },
  },
  server: { proxy: { "/api": { target: daemon, ws: true }, "/healthz": daemon, "/metrics": daemon } },
  test: { include: ["src/**/*.test.ts"], environment: "node" },
});
