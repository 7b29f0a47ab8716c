// What cameras' pictures add to a surface, per fragment: shaders/render/surface.wgsl in GLSL, weights after "Hybrid" (2004) sections
// 4.3 and 4.4. The camera's own numbers stand in `lenses` (LENS_GLSL) and, beside it, in `casts`.

import { MOST_PROJECTED } from "./choosing";
import { LENS_GLSL } from "./lensShader";

/** Vectors that a camera takes in `casts`: layer of its picture, opacity, faces of its depth map, first layer of that; middle and half
 * extent of a single face, tangents; gain of its colours, in linear light. */
export const CAST_VECTORS = 3;
/** Near plane of the depth maps, metres. */
export const DEPTH_NEAR_M = 0.05;

/** One camera after another, without a loop: rasterisers on a processor look constant places of an array up much faster. */
const ADDED = Array.from({ length: MOST_PROJECTED }, (_, i) =>
  `  #if N_LENSES > ${i}\n  add(${i}, point, normal, toViewer, material, pixels, blend);\n  #endif`).join("\n");

export const PROJECTION_GLSL = /* glsl */ `
#if N_LENSES > 0
${LENS_GLSL}
uniform vec4 casts[N_LENSES * ${CAST_VECTORS}];
uniform highp sampler2DArray pictures;
#ifdef HAS_DEPTH
uniform highp sampler2DArray depths;
#endif

// Distance from the border at which a picture counts in full, share of its size.
const float FEATHER = 0.06;
const float LEAST_SHARE = 1e-6;
// Sine of half a degree: what a camera sees at less than that is smeared beyond use.
const float LEAST_COSINE = 0.0087265;
// How much nearer, relative, what hides must be.
const float DEPTH_BIAS = float(DEPTH_BIAS_SHARE);

float fifthPower(float x) {
  float x2 = x * x;
  return x2 * x2 * x;
}

#ifdef HAS_DEPTH
// The share of the four nearest texels that nothing stands before. Each is held to the depth that the surface's plane has in its middle,
// so that surfaces at a slant need no wider bias; steps of depth are dilated before.
float openTo(int i, vec3 local, vec3 normal) {
  vec4 given = casts[i * ${CAST_VECTORS}];
  vec4 bounds = casts[i * ${CAST_VECTORS} + 1];
  vec3 onFace = local;
  vec3 turned = normal;
  float layer = given.w;
  #ifdef HAS_CUBES
  if (given.z > 1.5) {
    // Faces of a cube: forward, back, right, left, down, up.
    vec3 size = abs(local);
    if (size.z >= size.x && size.z >= size.y) {
      if (local.z < 0.0) { onFace = vec3(-local.x, local.y, -local.z); turned = vec3(-normal.x, normal.y, -normal.z); layer += 1.0; }
    } else if (size.x >= size.y) {
      bool isRight = local.x >= 0.0;
      onFace = isRight ? vec3(-local.z, local.y, local.x) : vec3(local.z, local.y, -local.x);
      turned = isRight ? vec3(-normal.z, normal.y, normal.x) : vec3(normal.z, normal.y, -normal.x);
      layer += isRight ? 2.0 : 3.0;
    } else {
      bool isBelow = local.y >= 0.0;
      onFace = isBelow ? vec3(local.x, -local.z, local.y) : vec3(local.x, local.z, -local.y);
      turned = isBelow ? vec3(normal.x, -normal.z, normal.y) : vec3(normal.x, normal.z, -normal.y);
      layer += isBelow ? 4.0 : 5.0;
    }
  }
  #endif
  // Rows of the map run upwards.
  vec2 place = 0.5 + vec2(0.5, -0.5) * (onFace.xy / onFace.z - bounds.xy) / bounds.zw;
  // On the plane normal . p = h the inverse of depth is normal . (x, y, 1) / h at the tangents x and y.
  float height = dot(turned, onFace);
  vec2 slope = turned.xy * vec2(2.0, -2.0) * bounds.zw * onFace.z / (height > -1e-12 ? -1e-12 : height);
  vec2 size = vec2(textureSize(depths, 0).xy);
  vec2 at = place * size - 0.5;
  vec2 low = floor(at);
  vec2 high = at - low;
  ivec3 first = ivec3(ivec2(low), int(layer + 0.5));
  ivec2 last = ivec2(size) - 1;
  float own = ${DEPTH_NEAR_M} / onFace.z;
  float here = own * (1.0 + DEPTH_BIAS - dot(high, slope) / size.x);
  vec2 onward = own * slope / size;
  vec4 limits = here + vec4(0.0, onward.x, onward.y, onward.x + onward.y);
  vec4 found = vec4(
    texelFetch(depths, ivec3(clamp(first.xy, ivec2(0), last), first.z), 0).r,
    texelFetch(depths, ivec3(clamp(first.xy + ivec2(1, 0), ivec2(0), last), first.z), 0).r,
    texelFetch(depths, ivec3(clamp(first.xy + ivec2(0, 1), ivec2(0), last), first.z), 0).r,
    texelFetch(depths, ivec3(clamp(first.xy + 1, ivec2(0), last), first.z), 0).r);
  vec4 open = step(found, limits);
  float share = mix(mix(open.x, open.y, high.x), mix(open.z, open.w, high.x), high.y);
  return given.z < 0.5 || onFace.z <= ${DEPTH_NEAR_M} ? 1.0 : share;
}
#endif

// Weights are fifth powers, summed relative to the greatest one met so far, so that none underflows.
struct Blend {
  vec3 sum;
  float weights;
  float greatest;
  float squarest;
  float opacity;
  vec3 fallback;
};

void add(const int i, vec3 point, vec3 normal, vec3 toViewer, vec3 material, vec2 pixels, inout Blend blend) {
  LensPlace seen = lensProject(i, point);
  vec4 given = casts[i * ${CAST_VECTORS}];
  // The geometric mean of a pixel's sides in the camera's picture.
  vec2 stepX = dFdx(seen.texture) * pixels;
  vec2 stepY = dFdy(seen.texture) * pixels;
  float level = max(0.25 * log2(max(dot(stepX, stepX) * dot(stepY, stepY), 1e-12)), 0.0);
  vec3 toCamera = normalize(lensPosition(i) - point);
  float cosine = dot(toCamera, normal);
  vec2 inset = min(seen.texture, 1.0 - seen.texture);
  float border = min(inset.x, inset.y);
  if (!(seen.isSeen && border >= 0.0 && cosine > LEAST_COSINE && given.y > 0.0)) return;
  #ifdef HAS_DEPTH
  float open = openTo(i, seen.local, lensTurned(i, normal));
  #else
  float open = 1.0;
  #endif
  vec4 shown = textureLod(pictures, vec3(seen.texture, given.x), level);
  // What is hidden of its picture the camera does not see: others may.
  if (shown.a < 0.999) return;
  vec3 color = min(shown.rgb * casts[i * ${CAST_VECTORS} + 2].rgb, vec3(1.0));
  if (open >= 0.5 && cosine > blend.squarest) {
    blend.squarest = cosine;
    blend.fallback = mix(material, color, given.y);
  }
  vec3 between = toCamera + toViewer;
  float s = cosine * 0.5 * dot(between, between);
  float share = smoothstep(0.0, FEATHER, border) * open * given.y;
  if (!(share > LEAST_SHARE)) return;
  blend.opacity = max(blend.opacity, given.y);
  float smaller = fifthPower(min(s, blend.greatest) / max(s, blend.greatest));
  bool isGreatest = s > blend.greatest;
  float keep = isGreatest ? smaller : 1.0;
  float weight = share * (isGreatest ? 1.0 : smaller);
  blend.sum = blend.sum * keep + weight * color;
  blend.weights = blend.weights * keep + weight;
  blend.greatest = max(blend.greatest, s);
}

// The colour of a place (relative to the anchor); the material's where no camera looks.
vec3 projected(vec3 point, vec3 facing, vec3 material) {
  vec3 viewer = vec3(cameraPosition.x, -cameraPosition.z, cameraPosition.y);
  vec3 toViewer = normalize(viewer - point);
  vec3 normal = dot(facing, toViewer) >= 0.0 ? facing : -facing;
  vec2 pixels = vec2(textureSize(pictures, 0).xy);
  Blend blend = Blend(vec3(0.0), 0.0, 0.0, 0.0, 0.0, material);
${ADDED}
  return blend.weights > 0.0 ? mix(material, blend.sum / max(blend.weights, 1e-30), blend.opacity) : blend.fallback;
}
#endif
`;
