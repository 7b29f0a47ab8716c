// Ids made of names: what the interface takes (a-z, 0-9, - and _, at most 64, the first a letter or digit), and no one twice.

const MOST_CHARS = 64;

export function isId(text: string): boolean {
  return /^[a-z0-9][a-z0-9_-]{0,63}$/.test(text);
}

/** An id that reads like the name and is not taken; `usual` where the name has no letter that an id takes. */
export function idFrom(name: string, taken: readonly string[], usual: string): string {
  // Letters with marks become those without.
  const plain = name.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase();
  const stem = plain.replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, MOST_CHARS - 4).replace(/-+$/, "") || usual;
  if (!taken.includes(stem)) return stem;
  for (let n = 2; ; n += 1) {
    if (!taken.includes(`${stem}-${n}`)) return `${stem}-${n}`;
  }
}

/** A name for what a file shows: its own without folders, ending and underscores. */
export function nameFrom(path: string): string {
  const file = path.split("/").at(-1) ?? "";
  const stem = file.replace(/\.[a-z0-9]{1,5}$/i, "").replace(/%0?\d*d/g, "").replace(/[_-]+/g, " ").trim();
  return stem === "" ? "" : (stem[0] ?? "").toUpperCase() + stem.slice(1);
}
