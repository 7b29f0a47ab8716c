// The pictures that repeat over a thing's walls and roof.

import { say } from "../../strings";
import { NumberField } from "../Fields";
import { changeThing } from "./actions";
import { faultAt } from "./fieldFaults";
import { tidy } from "./operations";
import { PictureField } from "./PictureField";
import type { Box, Texture, Thing } from "./things";

type Painted = Extract<Thing, { list: "boxes" | "cylinders" | "footprints" }>;
const SLOTS = ["texture", "roof_texture"] as const;
type Slot = (typeof SLOTS)[number];
/** How wide a picture is at first, metres. */
const WIDE_M = 2;

function paint({ of: { id } }: Painted, slot: Slot, change: (texture: Texture | undefined) => Texture | undefined, key: string): void {
  changeThing(id, `${slot} ${key}`, (now) => {
    const { [slot]: before, ...others } = now.of as Box;
    const texture = change(before);
    return { ...now, of: texture ? { ...others, [slot]: texture } : others } as Thing;
  });
}

function Paint({ one, slot }: { one: Painted; slot: Slot }) {
  const texture = one.of[slot];
  const fault = faultAt(one, `${slot}/file`) ?? faultAt(one, `${slot}/size_m`);
  return (
    <div class="geo-paint">
      <PictureField label={say(`geometry.${slot}`)} file={texture?.file} fault={fault}
        onPicture={(file, [width, height]) => paint(one, slot, (before) => {
          const wide = before?.size_m[0] ?? WIDE_M;
          return { file, size_m: [wide, tidy((wide * height) / width)] };
        }, "file")}
        onRemove={() => paint(one, slot, () => undefined, "remove")} />
      {texture && (
        <div class="geo-numbers">
          {([0, 1] as const).map((i) => (
            <NumberField key={i} label={say(i === 0 ? "geometry.repeat.width" : "geometry.repeat.height")} unit="m" min={0.001} max={100_000} value={texture.size_m[i] ?? 1}
              fault={faultAt(one, `${slot}/size_m/${i}`)}
              onChange={(value) => value !== null && paint(one, slot, (before) => before && { ...before, size_m: before.size_m.map((old, j) => (j === i ? value : old)) }, `size${i}`)} />
          ))}
        </div>
      )}
    </div>
  );
}

export function PaintFields({ one }: { one: Painted }) {
  const isPainted = SLOTS.some((slot) => one.of[slot]);
  return (
    <details class="geo-paints" open={isPainted}>
      <summary>{say("geometry.paint")}</summary>
      {SLOTS.map((slot) => <Paint key={slot} one={one} slot={slot} />)}
    </details>
  );
}
