// What a picture took, as `Server-Timing` tells it.

export type Stages = readonly { readonly name: string; readonly millis: number }[];

/** The stages in the order in which they were told. */
export function stages(field: string | null): Stages {
  return (field ?? "").split(",").flatMap((part) => {
    const [, name, millis] = /^\s*([\w-]+)\s*;.*\bdur=([\d.]+)/.exec(part) ?? [];
    return name === undefined || millis === undefined ? [] : [{ name, millis: Number(millis) }];
  });
}

/** What it is expected to take counts these. */
const DRAWING = ["fuse", "plan", "render"];

/** What fusing, planning and drawing took, milliseconds. */
export function drawnIn(told: Stages): number {
  return told.filter(({ name }) => DRAWING.includes(name)).reduce((sum, { millis }) => sum + millis, 0);
}
