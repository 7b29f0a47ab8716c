// The daemon's metrics as they come (Prometheus's text format), and what is made of two readings of them.

export type Sample = { readonly labels: Readonly<Record<string, string>>; readonly value: number };
export type Metrics = ReadonlyMap<string, readonly Sample[]>;

const LINE = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})? (\S+)/;
const LABEL = /(\w+)="((?:[^"\\]|\\.)*)"/g;

/** Reads all samples; what is no sample is left out, and so are the buckets of histograms, of which there are many. */
export function parse(text: string): Metrics {
  const found = new Map<string, Sample[]>();
  for (const line of text.split("\n")) {
    const [, name, labels = "", number = ""] = LINE.exec(line) ?? [];
    if (name === undefined || name.endsWith("_bucket")) continue;
    const value = Number(number.replace("+Inf", "Infinity"));
    const read = Object.fromEntries(Array.from(labels.matchAll(LABEL), ([, key = "", text = ""]) => [key, text.replace(/\\(.)/g, "$1")]));
    found.set(name, [...(found.get(name) ?? []), { labels: read, value }]);
  }
  return found;
}

/** The sum of a metric's samples whose labels are these. */
export function sum(metrics: Metrics, name: string, labels: Readonly<Record<string, string>> = {}): number {
  const wanted = Object.entries(labels);
  return (metrics.get(name) ?? []).filter((sample) => wanted.every(([key, value]) => sample.labels[key] === value)).reduce((all, { value }) => all + value, 0);
}

export type Reading = { readonly at: number; readonly metrics: Metrics };
export type Of = (metrics: Metrics) => number;

/** How fast a counter rose between two readings, a second; null where the daemon began anew between them. */
export function rate(of: Of, before: Reading, now: Reading): number | null {
  const [rise, secs] = [of(now.metrics) - of(before.metrics), (now.at - before.at) / 1e3];
  return rise < 0 || secs <= 0 ? null : rise / secs;
}

/** What one took on average between two readings, milliseconds; null where there was none. */
export function mean(total: Of, count: Of, before: Reading, now: Reading): number | null {
  const n = count(now.metrics) - count(before.metrics);
  const secs = total(now.metrics) - total(before.metrics);
  return n <= 0 || secs < 0 ? null : (secs / n) * 1e3;
}
