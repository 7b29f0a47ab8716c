// Where the cameras are and what way they look, so that one knows what their pictures show.

import type { Point } from "../../operate/orbit";
import type { SceneDocument } from "../draft";
import type { Eye } from "./eye";
import { enlarged } from "./near";
import { point } from "./things";

type Member = NonNullable<SceneDocument["cameras"]>[number];
const LENGTH_PX = 34;

/** A direction of the camera in the world: its quaternion (x, y, z, w) takes x right, y down, z forward there. */
export function turnedBy(quaternion: readonly number[], [x, y, z]: Point): Point {
  const [a = 0, b = 0, c = 0, w = 1] = quaternion;
  const [tx, ty, tz] = [2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)];
  return [x + w * tx + b * tz - c * ty, y + w * ty + c * tx - a * tz, z + w * tz + a * ty - b * tx];
}

function Mark({ eye, of: { id, calibration } }: { eye: Eye; of: Member }) {
  if (!("position_m" in calibration)) return null;
  const at = point(calibration.position_m);
  const place = eye.place(at);
  if (!place) return null;
  const [width = 1, height = 1] = calibration.image_size_px;
  const [fx = 1, fy = fx] = calibration.focal_px;
  const length = LENGTH_PX * enlarged() * eye.metresPerPx(at);
  const corners = ([[-1, -1], [1, -1], [1, 1], [-1, 1]] as const).map(([sx, sy]): Point => {
    const [dx, dy, dz] = turnedBy(calibration.world_from_camera, [(sx * width) / 2 / fx, (sy * height) / 2 / fy, 1]);
    return [at[0] + dx * length, at[1] + dy * length, at[2] + dz * length];
  });
  const lines = [...eye.lines(corners, true), ...corners.flatMap((corner) => eye.lines([at, corner], false))];
  return (
    <g class="geo-camera">
      <path d={lines.map((piece) => `M${piece.map((px) => px.map((n) => n.toFixed(1)).join(" ")).join("L")}`).join("")} />
      <circle cx={place[0]} cy={place[1]} r={4} />
      <text x={place[0] + 7} y={place[1] - 7}>{id}</text>
    </g>
  );
}

export function CameraMarks({ eye, cameras }: { eye: Eye; cameras: readonly Member[] }) {
  return <g>{cameras.map((of) => <Mark key={of.id} eye={eye} of={of} />)}</g>;
}
