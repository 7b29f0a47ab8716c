// Lines that are drawn along a building: which axis the next one runs along, and one end that waits for the other.

import { signal } from "@preact/signals";
import type { AxisLine } from "../draft";
import type { Pixel } from "./pairs";

export const AXES = ["x", "y", "z"] as const;
export type Axis = AxisLine["axis"];

/** As three.js and most programs draw axes; light enough for dark pictures, with a dark border for light ones. */
export const AXIS_COLORS: Readonly<Record<Axis, string>> = { x: "#ff6b5e", y: "#6ee07a", z: "#6aa8ff" };

export const axis = signal<Axis>("x");
export const begun = signal<Pixel | null>(null);
