// A value over the last minutes, small: to see whether it rises.

import { say } from "../strings";

const [WIDTH, HEIGHT] = [120, 28];

/** `values` in equal steps of time, the newest last; null where there is none. */
export function Sparkline({ name, values, text }: { name: string; values: readonly (number | null)[]; text: (value: number) => string }) {
  const known = values.filter((value) => value !== null);
  if (known.length === 0) return <svg class="sparkline" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={say("system.spark.none", { name })} />;
  const [least, most] = [Math.min(0, ...known), Math.max(...known)];
  const x = (i: number) => (values.length < 2 ? WIDTH : (i / (values.length - 1)) * WIDTH);
  const y = (value: number) => HEIGHT - 2 - ((value - least) / Math.max(most - least, 1e-12)) * (HEIGHT - 4);
  const path = values.reduce<string>((line, value, i) => {
    if (value === null) return line;
    const isBegun = i > 0 && values[i - 1] !== null && line !== "";
    return `${line}${isBegun ? "L" : "M"}${x(i).toFixed(1)} ${y(value).toFixed(1)}`;
  }, "");
  const last = known.at(-1) ?? 0;
  return (
    <svg class="sparkline" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img"
      aria-label={say("system.spark", { name, last: text(last), least: text(Math.min(...known)), most: text(most) })}>
      <path d={path} vector-effect="non-scaling-stroke" />
    </svg>
  );
}
