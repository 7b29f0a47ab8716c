// Figures that tests measure and do not judge by, for who writes them down: target/web-e2e-daemon/figures.json.

import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";

const FOLDER = resolve(import.meta.dirname, "../../target/web-e2e-daemon");
const FILE = resolve(FOLDER, "figures.json");

/** Writes a figure down beside the others. */
export function note(name: string, value: unknown): void {
  mkdirSync(FOLDER, { recursive: true });
  let before: Record<string, unknown> = {};
  try {
    before = JSON.parse(readFileSync(FILE, "utf8")) as Record<string, unknown>;
  } catch {
    // The first one.
  }
  writeFileSync(FILE, `${JSON.stringify({ ...before, [name]: value }, null, 2)}\n`);
}
