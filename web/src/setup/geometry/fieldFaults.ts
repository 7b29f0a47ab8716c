// What is wrong at a field of a thing.

import { say } from "../../strings";
import { atThing } from "../faults";
import { checkThing } from "./checks";
import type { Thing } from "./things";

/** What is wrong at a field: what the page sees itself, else what the daemon said. */
export function faultAt(one: Thing, field: string): string | undefined {
  const own = checkThing(one).find((check) => check.field === field);
  return own ? say(`geometry.check.${own.key}`, own.values) : atThing("geometry", { thing: one.of.id }, field);
}
