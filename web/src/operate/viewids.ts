// Ids that the daemon takes, made of names that people give.

const MOST = 48;

/** An id for a name, other than those that are taken, with the ending that the user's names must have. */
export function idFor(name: string, taken: ReadonlySet<string>, ending = ""): string {
  const plain = name.normalize("NFKD").replace(/[\u0300-\u036f]/g, "").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, MOST);
  const base = plain === "" ? "view" : plain;
  for (let i = 1; ; i += 1) {
    const id = `${i === 1 ? base : `${base}-${i}`}${ending}`;
    if (!taken.has(id)) return id;
  }
}
