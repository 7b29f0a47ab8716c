// The camera model for shaders: shaders/common/camera.wgsl in GLSL. A lens is some vectors of one uniform array, so that a shader
// can go through many.

import { Vector4 } from "three";
import type { Point } from "../operate/orbit";
import { NEAR_M } from "./distortion";
import type { Lens } from "./lens";

/** Vectors that a lens takes in the array. */
export const LENS_VECTORS = 8;

const MODELS = { none: 0, brown_conrady: 1, fisheye: 2 } as const;
/** Beyond this tangent nothing is looked for. */
const WIDEST_TANGENT = 1e4;

/** What shaders know of a lens, as `LENS_GLSL` wants it; places are relative to `anchor`, in world axes. */
export function lensUniform(lens: Lens, anchor: Point = [0, 0, 0]): Vector4[] {
  const from: Point = [lens.position[0] - anchor[0], lens.position[1] - anchor[1], lens.position[2] - anchor[2]];
  const { model, k, fold } = lens.distortion;
  const at = (i: number) => k[i] ?? 0;
  return [
    ...lens.axes.map(([x, y, z]) => new Vector4(x, y, z, -(x * from[0] + y * from[1] + z * from[2]))),
    new Vector4(...from, MODELS[model]),
    new Vector4(...lens.focal, ...lens.center),
    new Vector4(at(0), at(1), at(2), at(3)),
    new Vector4(at(4), at(5), at(6), at(7)),
    // In every direction the same: with tangential terms a little of the border may be left out.
    new Vector4(model === "fisheye" ? fold.maxTheta : Math.min(fold.maxRadius, WIDEST_TANGENT), 0, 0, 0),
  ];
}

/** Switches of `LENS_GLSL` for such lenses: rasterisers on a processor run both sides of every branch. */
export function lensDefines(lenses: readonly Lens[]): Record<string, number | null> {
  const has = (model: string) => (lenses.some(({ distortion }) => distortion.model === model) ? 1 : null);
  return { N_LENSES: lenses.length, HAS_BROWN_CONRADY: has("brown_conrady"), HAS_FISHEYE: has("fisheye") };
}

/** Wants `lensDefines` to be defined. `lensProject(i, point)`: where the lens that stands `i`th shows a point relative to the anchor.
 * Free of divergent branches, so that neighbouring pixels' results may be subtracted. */
export const LENS_GLSL = /* glsl */ `
uniform vec4 lenses[N_LENSES * ${LENS_VECTORS}];

struct LensPlace {
  vec2 texture; // [0, 1] within the picture, from its upper left corner; means nothing unless isSeen
  vec3 local; // in the camera's axes: x right, y down, z forward
  bool isSeen;
};

vec3 lensPosition(int i) {
  return lenses[i * ${LENS_VECTORS} + 3].xyz;
}

vec3 lensTurned(int i, vec3 direction) {
  int first = i * ${LENS_VECTORS};
  return vec3(dot(lenses[first].xyz, direction), dot(lenses[first + 1].xyz, direction), dot(lenses[first + 2].xyz, direction));
}

vec2 lensBrownConrady(vec4 low, vec4 high, vec2 p) {
  float r2 = dot(p, p);
  float above = 1.0 + r2 * (low.x + r2 * (low.y + r2 * high.x));
  float below = 1.0 + r2 * (high.y + r2 * (high.z + r2 * high.w));
  return p * (above / below) + vec2(
    2.0 * low.z * p.x * p.y + low.w * (r2 + 2.0 * p.x * p.x),
    low.z * (r2 + 2.0 * p.y * p.y) + 2.0 * low.w * p.x * p.y);
}

LensPlace lensProject(int i, vec3 point) {
  int first = i * ${LENS_VECTORS};
  vec4 from = vec4(point, 1.0);
  vec3 local = vec3(dot(lenses[first], from), dot(lenses[first + 1], from), dot(lenses[first + 2], from));
  float model = lenses[first + 3].w;
  vec4 focal = lenses[first + 4];
  vec4 low = lenses[first + 5];
  float limit = lenses[first + 7].x;
  bool isSeen = local.z > ${NEAR_M};
  vec2 shown = local.xy / (isSeen ? local.z : 1.0);
  #ifdef HAS_BROWN_CONRADY
  if (model == 1.0) {
    isSeen = isSeen && length(shown) < limit;
    shown = lensBrownConrady(low, lenses[first + 6], shown);
  }
  #endif
  #ifdef HAS_FISHEYE
  if (model == 2.0) {
    float radius = length(local.xy);
    // The built-in function of two arguments is undefined where both are 0.
    float theta = atan(radius, local.z == 0.0 ? 1e-20 : local.z);
    float t2 = theta * theta;
    float bent = theta * (1.0 + t2 * (low.x + t2 * (low.y + t2 * (low.z + t2 * low.w))));
    isSeen = length(local) > ${NEAR_M} && theta < limit;
    shown = local.xy * (radius < 1e-6 * abs(local.z) ? 1.0 / local.z : bent / max(radius, 1e-20));
  }
  #endif
  return LensPlace(focal.xy * shown + focal.zw, local, isSeen);
}
`;
