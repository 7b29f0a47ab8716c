// Pictures and models that the draft names as `assets/NAME` and that the daemon has not got yet. They stand in the browser's own
// database, so that reloading loses nothing, and go to the daemon when the draft is saved.

import { signal } from "@preact/signals";
import { send } from "../ask";
import type { SceneDocument } from "./draft";

const FOLDER = "assets/";
const DATABASE = "videofields.setup";
const STORE = "files";
/** What the daemon takes, and what of it pictures are whose names end otherwise. */
const ENDINGS = [".png", ".jpg", ".jpeg", ".glb", ".ply"];
const ENDING_OF: Readonly<Record<string, string>> = { "image/png": ".png", "image/jpeg": ".jpg" };

/** What could not be put into the browser's database stands here, until the page goes. */
const inMemory = new Map<string, Blob>();
const urls = new Map<string, string>();
/** Counts files that came, for what shows them. */
export const filesChanged = signal(0);
/** Whether a file is kept nowhere but on this page: it would be lost with it. */
export const areFilesUnkept = signal(false);

function opened(): Promise<IDBDatabase> {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(DATABASE, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(STORE);
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error ?? new Error("indexedDB"));
  });
}

async function inStore<Answer>(mode: IDBTransactionMode, ask: (store: IDBObjectStore) => IDBRequest<Answer>): Promise<Answer> {
  const database = await opened();
  try {
    return await new Promise((resolve, reject) => {
      const transaction = database.transaction(STORE, mode);
      const request = ask(transaction.objectStore(STORE));
      transaction.oncomplete = () => resolve(request.result);
      transaction.onerror = transaction.onabort = () => reject(transaction.error ?? new Error("indexedDB"));
    });
  } finally {
    database.close();
  }
}

/** A number of the file's bytes: another file of the same name gets another name. Not for secrets (FNV-1a, twice). */
export function digest(bytes: Uint8Array): string {
  let [low, high] = [0x811c9dc5, 0x9747b28c];
  for (const byte of bytes) {
    low = Math.imul(low ^ byte, 0x01000193);
    high = Math.imul(high ^ byte ^ (low >>> 24), 0x01000193);
  }
  return [low, high].map((part) => (part >>> 0).toString(16).padStart(8, "0")).join("").slice(0, 12);
}

/** The name under which a file is kept: its own, and a digest, so that what is kept never changes under a name; with an ending that
 * the daemon takes. */
export function assetName(name: string, bytes: Uint8Array, type = ""): string {
  const [, stem = "", own = ""] = /^(.*?)(\.[a-z0-9]+)?$/i.exec(name.toLowerCase()) ?? [];
  const ending = ENDINGS.includes(own) ? own : (ENDING_OF[type] ?? own);
  const plain = stem.normalize("NFKD").replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 40);
  return `${plain || "file"}-${digest(bytes)}${ending}`;
}

/** Keeps a file for the draft, and answers what the scene's document names it. */
export async function keepFile(file: File): Promise<string> {
  const name = assetName(file.name, new Uint8Array(await file.arrayBuffer()), file.type);
  try {
    await inStore("readwrite", (store) => store.put(file, name));
  } catch {
    inMemory.set(name, file);
    areFilesUnkept.value = true;
  }
  filesChanged.value += 1;
  return FOLDER + name;
}

/** The file that the document names so, if it stands in this browser. */
export async function fileOf(path: string): Promise<Blob | null> {
  if (!path.startsWith(FOLDER)) return null;
  const name = path.slice(FOLDER.length);
  const held = inMemory.get(name);
  if (held) return held;
  try {
    return (await inStore<Blob | undefined>("readonly", (store) => store.get(name) as IDBRequest<Blob | undefined>)) ?? null;
  } catch {
    return null;
  }
}

/** An address under which the page can show what a document names so: this browser's file, or the daemon's; null where neither
 * has it, as with files that the configuration's scenes name. */
export async function urlOf(path: string): Promise<string | null> {
  const known = urls.get(path);
  if (known !== undefined) return known;
  if (!path.startsWith(FOLDER)) return null;
  let blob = await fileOf(path);
  if (!blob) {
    const response = await send(`/api/v1/assets/${encodeURIComponent(path.slice(FOLDER.length))}`);
    if (!response.ok) return null;
    blob = await response.blob();
  }
  const url = URL.createObjectURL(blob);
  urls.set(path, url);
  return url;
}

/** All files of the daemon's assets that a document names. */
export function namedFiles(document: SceneDocument): string[] {
  const found = new Set<string>();
  const visit = (value: unknown) => {
    if (typeof value === "string" && value.startsWith(FOLDER)) found.add(value);
    else if (typeof value === "object" && value !== null) Object.values(value).forEach(visit);
  };
  visit(document);
  return [...found];
}

/** Lets go of files in this browser: of these, or of all. */
export async function forgetFiles(paths?: readonly string[]): Promise<void> {
  const names = paths?.map((path) => path.slice(FOLDER.length));
  if (names) names.forEach((name) => inMemory.delete(name));
  else inMemory.clear();
  areFilesUnkept.value = inMemory.size > 0;
  try {
    if (!names) await inStore("readwrite", (store) => store.clear());
    for (const name of names ?? []) await inStore("readwrite", (store) => store.delete(name));
  } catch {
    // Then they were not there either.
  }
}
