// The camera in the hand, in the scene: handles to carry it over the ground, lift it, point it, roll it and open its view. Each is a
// button, so that keys move it too.

import { useRef } from "preact/hooks";
import type { Point } from "../../operate/orbit";
import { ray } from "../../spatial/lens";
import { say } from "../../strings";
import { type Calibration, settle } from "../draft";
import { type Eye, onLevel, onUpright } from "../geometry/eye";
import { begun, hold } from "./edits";
import { eye, sight } from "./eyeing";
import { anglesOf, carriedTo, fovOf, pointedAt, withAngles, withFov } from "./holding";
import * as now from "./now";
import type { Pixel } from "./pairs";
import { document } from "./scene";
import { add, aim, dot, extent, length, minus, point } from "./torch";

const NAMES = ["foot", "head", "aim", "roll", "open"] as const;
type Name = (typeof NAMES)[number];

const STEP_M = [0.1, 1] as const;
const STEP_DEG = [0.5, 5] as const;
const LEAST_HEIGHT_M = 0.1;
/** How far above the camera its roll is taken hold of, share of its distance from the viewer. */
const ROLL_SHARE = 0.08;

type Held = { readonly calibration: Calibration; readonly at: Pixel; readonly level_m: number };

/** Where a handle is. */
function spot(name: Name, of: Calibration, level_m: number, from: Point): Point | null {
  const head = point(of.position_m);
  const lens = now.lens.value;
  if (!lens) return null;
  const target = aim(of, level_m);
  switch (name) {
    case "foot": return [head[0], head[1], level_m];
    case "head": return head;
    case "aim": return target;
    case "roll": return add(head, lens.axes[1], -ROLL_SHARE * length(minus(head, from)));
    case "open": {
      const side = ray(lens, [1, 0.5]);
      return side && add(head, side.direction, length(minus(target, head)));
    }
  }
}

/** What dragging a handle makes of the calibration that it was taken hold of with. */
function dragged(name: Name, held: Held, to: Pixel, view: Eye): Calibration | null {
  const { calibration: of, level_m } = held;
  const [x, y, z] = point(of.position_m);
  const through = view.ray(to);
  if (name === "foot" || name === "aim") {
    const ground = onLevel(through, level_m);
    if (!ground) return null;
    return name === "foot" ? carriedTo(of, [...ground, z], level_m) : pointedAt(of, [...ground, level_m]);
  }
  if (name === "head") {
    const height = onUpright(through, [x, y]);
    return height === null ? null : carriedTo(of, [x, y, Math.max(height, level_m + LEAST_HEIGHT_M)], level_m);
  }
  const centre = view.place(name === "roll" ? [x, y, z] : aim(of, level_m));
  if (!centre) return null;
  if (name === "roll") {
    const turn = (at: Pixel) => Math.atan2(at[1] - centre[1], at[0] - centre[0]);
    const forward = now.lens.value?.axes[2] ?? [0, 0, 1];
    // Seen from the front, clockwise is the other way round.
    const side = dot(forward, minus([x, y, z], through.from)) >= 0 ? 1 : -1;
    const by = ((turn(to) - turn(held.at)) * 180) / Math.PI;
    const roll = anglesOf(of).roll_deg + side * by;
    return withAngles(of, { roll_deg: ((roll + 540) % 360) - 180 });
  }
  const reach = (at: Pixel) => Math.hypot(at[0] - centre[0], at[1] - centre[1]);
  const half = Math.tan((fovOf(of) * Math.PI) / 360) * (reach(to) / Math.max(reach(held.at), 1));
  return withFov(of, (2 * Math.atan(half) * 180) / Math.PI);
}

/** What keys make of it. */
function keyed(name: Name, of: Calibration, event: KeyboardEvent, level_m: number): Calibration | null {
  const i = event.shiftKey ? 1 : 0;
  const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [];
  if (dx === undefined || dy === undefined) return null;
  const [x, y, z] = point(of.position_m);
  switch (name) {
    case "foot": return carriedTo(of, [x + dx * STEP_M[i], y + dy * STEP_M[i], z], level_m);
    case "head": return carriedTo(of, [x, y, Math.max(z + dy * STEP_M[i], level_m + LEAST_HEIGHT_M)], level_m);
    case "aim": return pointedAt(of, add(aim(of, level_m), [dx * STEP_M[i], dy * STEP_M[i], 0]));
    case "roll": return withAngles(of, { roll_deg: anglesOf(of).roll_deg + (dx + dy) * STEP_DEG[i] });
    case "open": return withFov(of, fovOf(of) + (dx + dy) * STEP_DEG[i]);
  }
}

function Handle({ name, at, of, level_m }: { name: Name; at: Pixel; of: Calibration; level_m: number }) {
  const held = useRef<(Held & { key: string; off: Pixel }) | null>(null);
  const place = (event: PointerEvent): Pixel => {
    const box = (event.currentTarget as Element).parentElement?.getBoundingClientRect();
    return [event.clientX - (box?.left ?? 0), event.clientY - (box?.top ?? 0)];
  };
  const down = (event: PointerEvent) => {
    if (event.button !== 0) return;
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    const pointer = place(event);
    held.current = { calibration: of, at, level_m, key: begun(), off: [at[0] - pointer[0], at[1] - pointer[1]] };
  };
  const move = (event: PointerEvent) => {
    const [from, view] = [held.current, eye.value];
    if (!from || !view) return;
    const [x, y] = place(event);
    const next = dragged(name, from, [x + from.off[0], y + from.off[1]], view);
    if (next) hold(next, from.key);
  };
  const up = () => {
    held.current = null;
    settle();
  };
  const key = (event: KeyboardEvent) => {
    const next = keyed(name, of, event, level_m);
    if (!next) return;
    event.preventDefault();
    event.stopPropagation();
    hold(next, `cameras:handle:${name}`);
  };
  return (
    <button type="button" class={`cal-handle is-${name}`} style={{ left: `${at[0]}px`, top: `${at[1]}px` }} aria-label={say(`cameras.handle.${name}`)} title={say(`cameras.handle.${name}`)}
      onPointerDown={down} onPointerMove={move} onPointerUp={up} onPointerCancel={up} onKeyDown={key} />
  );
}

export function Handles() {
  const [of, view] = [now.shown.value, eye.value];
  if (!of || !view || now.how.value !== "torch") return null;
  const { level_m } = extent(document.value);
  const from = view.ray([view.size_px[0] / 2, view.size_px[1] / 2]).from;
  return (
    <>
      {NAMES.map((name) => {
        // From above the camera hides its own foot, and its height is not to be seen.
        if (sight.value === "map" && (name === "head" || name === "roll")) return null;
        const place = spot(name, of, level_m, from);
        const at = place && view.place(place);
        return at && <Handle key={name} name={name} at={at} of={of} level_m={level_m} />;
      })}
    </>
  );
}
