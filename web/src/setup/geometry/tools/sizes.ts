// The sizes of what is being drawn, as people say them.

import { say } from "../../../strings";
import { distance } from "../outline";
import { type Drawing, outlineOf } from "./drawing";

/** The sizes of what is drawn, as people say them. */
export function sizes(of: Drawing): string {
  const outline = outlineOf(of);
  const metres = (length: number) => length.toFixed(2);
  const [a = of.pointer, b = a, c = b] = outline;
  switch (of.tool) {
    case "box":
      return say("geometry.size.box", { width: metres(distance(a, b)), depth: metres(distance(b, c)) });
    case "cylinder":
      return say("geometry.size.cylinder", { radius: metres(distance(of.corners[0] ?? of.pointer, of.corners[1] ?? of.pointer)) });
    default: {
      const isNew = distance(of.corners.at(-1) ?? of.pointer, of.pointer) > 0;
      const [from = of.pointer, to = from] = isNew ? [of.corners.at(-1), of.pointer] : of.corners.slice(-2);
      return say("geometry.size.line", { length: metres(distance(from, to)) });
    }
  }
}
