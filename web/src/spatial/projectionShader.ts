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
// Whether nothing stands before a point: 1, or 0. Near over distance is affine over a plane's picture, so what is filtered between
// texels of a plane is that plane's; steps of depth are dilated, so that no mixture of two surfaces counts.
float openTo(int i, vec3 local) {
  vec4 given = casts[i * ${CAST_VECTORS}];
  vec4 bounds = casts[i * ${CAST_VECTORS} + 1];
  vec3 onFace = local;
  float layer = given.w;
  #ifdef HAS_CUBES
  if (given.z > 1.5) {
    // Faces of a cube: forward, back, right, left, down, up.
    vec3 size = abs(local);
    if (size.z >= size.x && size.z >= size.y) {
      if (local.z < 0.0) { onFace = vec3(-local.x, local.y, -local.z); layer += 1.0; }
    } else if (size.x >= size.y) {
      onFace = local.x >= 0.0 ? vec3(-local.z, local.y, local.x) : vec3(local.z, local.y, -local.x);
      layer += local.x >= 0.0 ? 2.0 : 3.0;
    } else {
      onFace = local.y >= 0.0 ? vec3(local.x, -local.z, local.y) : vec3(local.x, local.z, -local.y);
      layer += local.y >= 0.0 ? 4.0 : 5.0;
    }
  }
  #endif
  vec2 tangent = (onFace.xy / onFace.z - bounds.xy) / bounds.zw;
  // Rows of the map run upwards.
  float depth = texture(depths, vec3(0.5 + 0.5 * tangent.x, 0.5 - 0.5 * tangent.y, layer)).r;
  bool isUnknown = given.z < 0.5 || onFace.z <= ${DEPTH_NEAR_M};
  return isUnknown || depth * onFace.z <= ${DEPTH_NEAR_M} * (1.0 + DEPTH_BIAS) ? 1.0 : 0.0;
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
  float open = openTo(i, seen.local);
  #else
  float open = 1.0;
  #endif
  vec4 shown = textureLod(pictures, vec3(seen.texture, given.x), level);
  // What is hidden of its picture the camera does not see: others may.
  if (shown.a < 0.999) return;
  vec3 color = min(shown.rgb * casts[i * ${CAST_VECTORS} + 2].rgb, vec3(1.0));
  if (open > 0.5 && cosine > blend.squarest) {
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
