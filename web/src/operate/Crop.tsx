// Somebody as one camera sees them: the part of its picture around them.

import { project } from "../spatial/lens";
import { CameraPicture } from "./CameraPicture";
import type { Person } from "./people";
import { lenses } from "./scenery";
import * as state from "./state";

const EVERY_MILLIS = 250;
/** The crop is so many times as high as they are. */
const ROOM = 1.9;
/** Width over height. */
const SHAPE = 0.8;
const LEAST_SHARE = 0.18;

type Part = { left: number; top: number; width: number; height: number };

/** The part of the picture to show, shares of it; all of it where the camera has no lens that is known. */
export function partOf(person: Person, camera: state.Camera): Part {
  const whole = { left: 0, top: 0, width: 1, height: 1 };
  const lens = lenses.value.get(camera.id);
  const [x, y, z] = person.position;
  const [foot, head] = lens ? [project(lens, [x, y, z]), project(lens, [x, y, z + person.height])] : [null, null];
  if (!foot || !head || !camera.size_px) return whole;
  const [columns = 16, rows = 9] = camera.size_px;
  const height = Math.min(1, Math.max(Math.abs(foot.v - head.v) * ROOM, LEAST_SHARE));
  const width = Math.min(1, (height * SHAPE * rows) / columns);
  const within = (middle: number, extent: number) => Math.min(Math.max(middle - extent / 2, 0), 1 - extent);
  return { left: within((foot.u + head.u) / 2, width), top: within((foot.v + head.v) / 2, height), width, height };
}

export function Crop({ person, camera }: { person: Person; camera: state.Camera }) {
  const part = partOf(person, camera);
  const style = {
    width: `${100 / part.width}%`,
    left: `${(-100 * part.left) / part.width}%`,
    top: `${(-100 * part.top) / part.height}%`,
  };
  const [columns = 16, rows = 9] = camera.size_px ?? [];
  return (
    <div class="crop" data-camera={camera.id} style={{ aspectRatio: `${part.width * columns} / ${part.height * rows}` }}>
      <div class="crop-inner" style={style}>
        <CameraPicture key={camera.id} camera={camera} kind="frame" at={state.at.value} everyMillis={EVERY_MILLIS} />
      </div>
    </div>
  );
}
