// Figures that tests measure and do not judge by, for who writes them down: target/web-e2e-daemon/figures.json.

import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import type { Page } from "@playwright/test";

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

/** What the person did: every press of a button or key on the page. */
export async function counted(page: Page): Promise<() => Promise<{ clicks: number; keys: number }>> {
  await page.addInitScript(() => {
    const count = JSON.parse(sessionStorage.getItem("counted") ?? '{"clicks":0,"keys":0}') as { clicks: number; keys: number };
    const keep = () => sessionStorage.setItem("counted", JSON.stringify(count));
    addEventListener("pointerdown", () => { count.clicks += 1; keep(); }, { capture: true });
    addEventListener("keydown", () => { count.keys += 1; keep(); }, { capture: true });
  });
  return () => page.evaluate(() => JSON.parse(sessionStorage.getItem("counted") ?? "{}") as { clicks: number; keys: number });
}
