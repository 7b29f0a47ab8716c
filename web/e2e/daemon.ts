// The daemon that the tests ask: the demo plaza, with the pages that were built, on a port and a database of its own.

import { type ChildProcess, spawn } from "node:child_process";
import { createWriteStream, mkdirSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { resolve } from "node:path";

const ROOT = resolve(import.meta.dirname, "../..");
const FOLDER = resolve(ROOT, "target/web-e2e-daemon");
const PATIENCE_MILLIS = 60_000;

function freePort(): Promise<number> {
  return new Promise((found, fail) => {
    const server = createServer();
    server.on("error", fail);
    server.listen(0, "127.0.0.1", () => {
      const address = server.address();
      server.close(() => found(typeof address === "object" && address ? address.port : 0));
    });
  });
}

export type Daemon = { url: string; stop: () => Promise<void>; start: () => Promise<void> };

/** The folder of the demo: its clips are what daemons of tests may read. */
export const DEMO = resolve(ROOT, "config/demo");

type Wanted = { config?: string; roots?: readonly string[]; records?: boolean };

/** A daemon that can be stopped and started again on the same port, with the same database: of the demo, or of a configuration of
 * its own (TOML; an empty one has neither cameras nor scenes), which may read files beneath `roots`; and whether it records. */
export async function daemon(name: string, { config, roots = [DEMO], records = false }: Wanted = {}): Promise<Daemon> {
  const port = await freePort();
  const url = `http://127.0.0.1:${port}`;
  mkdirSync(FOLDER, { recursive: true });
  const database = resolve(FOLDER, `${name}.sqlite`);
  for (const suffix of ["", "-wal", "-shm"]) rmSync(`${database}${suffix}`, { force: true });
  for (const kept of ["snapshots", "assets", "archive"]) rmSync(resolve(FOLDER, `${name}.${kept}`), { force: true, recursive: true });
  const target = process.env["CARGO_TARGET_DIR"] ?? resolve(ROOT, "target");
  const binary = process.env["VIDEOFIELDS"] ?? resolve(target, "debug/videofields");
  let asked = ["demo", "--listen", `127.0.0.1:${port}`];
  if (config !== undefined) {
    const file = resolve(FOLDER, `${name}.toml`);
    writeFileSync(file, `[server]\nlisten = "127.0.0.1:${port}"\n\n[media]\nroots = ${JSON.stringify(roots)}\n\n${config}`);
    asked = ["serve", "--config", file];
  }
  let child: ChildProcess | null = null;
  const start = async () => {
    const env = {
      ...process.env,
      NODEVICE_SELECT: "1",
      VIDEOFIELDS_STORAGE__DATABASE: database,
      VIDEOFIELDS_ACCURACY__MEASURE_AT_START: "false",
      // The most that may be set: machines of tests are slow.
      VIDEOFIELDS_RENDER__TIMEOUT_SECS: "10",
      ...(records ? { VIDEOFIELDS_ARCHIVE__FOLDER: resolve(FOLDER, `${name}.archive`), VIDEOFIELDS_ARCHIVE__SEGMENT_SECS: "5" } : {}),
    };
    const started = spawn(binary, asked, { cwd: ROOT, env, stdio: ["ignore", "pipe", "pipe"] });
    const log = createWriteStream(resolve(FOLDER, `${name}.log`), { flags: "a" });
    started.stdout.pipe(log);
    started.stderr.pipe(log);
    child = started;
    for (const begun = Date.now(); ; ) {
      const live = await fetch(`${url}/api/v1/cameras`).then((answer) => answer.text(), () => "");
      // Where there are users it answers strangers, and that is enough.
      if (config !== undefined && live !== "") return;
      if (live.includes("problem:") || live.split('"state":"live"').length === 4) return;
      if (started.exitCode !== null || Date.now() - begun > PATIENCE_MILLIS) throw new Error(`the daemon does not start: ${FOLDER}/${name}.log`);
      await new Promise((resolve) => setTimeout(resolve, 200));
    }
  };
  const stop = () =>
    new Promise<void>((resolve) => {
      if (!child || child.exitCode !== null) {
        resolve();
        return;
      }
      child.once("exit", () => resolve());
      child.kill("SIGTERM");
      child = null;
    });
  await start();
  return { url, stop, start };
}

/** One daemon for all tests that change nothing. */
export default async function setUp(): Promise<() => Promise<void>> {
  const shared = await daemon("shared");
  process.env["E2E_URL"] = shared.url;
  return shared.stop;
}
