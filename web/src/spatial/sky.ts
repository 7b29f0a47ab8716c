// What is seen where nothing stands (shaders/render/sky.wgsl): one triangle behind everything.

import { BufferAttribute, BufferGeometry, Color, GLSL3, Mesh, ShaderMaterial, type Texture } from "three";
import type { components } from "../contract.gen";

export type Sky = NonNullable<components["schemas"]["Scene"]["sky"]>;

const PLAIN = "#87b5dd";

const VERTEX = /* glsl */ `
out vec3 vDirection;
void main() {
  vec4 ahead = inverse(projectionMatrix) * vec4(position.xy, 1.0, 1.0);
  vec3 three = transpose(mat3(viewMatrix)) * ahead.xyz / ahead.w;
  vDirection = vec3(three.x, -three.z, three.y);
  gl_Position = vec4(position.xy, 1.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 pc_fragColor;
#define gl_FragColor pc_fragColor
in vec3 vDirection;
uniform vec3 zenith;
uniform vec3 horizon;
uniform vec3 ground;
uniform float yaw;
uniform sampler2D map;
void main() {
  vec3 direction = normalize(vDirection);
  #ifdef HAS_MAP
  float across = length(direction.xy);
  float azimuth = across > 1e-6 ? atan(direction.y, direction.x) : yaw;
  vec2 place = vec2(0.5 - (azimuth - yaw) / 6.283185307179586, 0.5 - atan(direction.z, across) / 3.141592653589793);
  // By angles on the sphere: steps in the picture leap at its seam and at its poles.
  vec3 x = dFdx(direction);
  vec3 y = dFdy(direction);
  float pixel = sqrt(max(dot(x, x), dot(y, y)));
  float level = max(log2(max(pixel * float(textureSize(map, 0).y) / 3.141592653589793, 1e-6)), 0.0);
  vec3 final = textureLod(map, place, level).rgb;
  #else
  vec3 above = mix(horizon, zenith, max(direction.z, 0.0));
  vec3 final = mix(above, ground, smoothstep(0.0, 0.0174524, -direction.z));
  #endif
  gl_FragColor = vec4(final, 1.0);
  #include <colorspace_fragment>
}
`;

/** The sky as an object that is drawn behind all others. `map` is its picture, once that is there. */
export function skyOf(sky: Sky | undefined, map: Texture | null = null): Mesh {
  const plain = sky?.color_srgb ?? PLAIN;
  const { zenith_srgb = plain, horizon_srgb = plain, ground_srgb = plain } = sky?.gradient ?? {};
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
  const material = new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    depthWrite: false,
    defines: map ? { HAS_MAP: 1 } : {},
    uniforms: {
      zenith: { value: new Color(zenith_srgb) },
      horizon: { value: new Color(horizon_srgb) },
      ground: { value: new Color(ground_srgb) },
      yaw: { value: ((sky?.picture?.yaw_deg ?? 0) * Math.PI) / 180 },
      map: { value: map },
    },
  });
  const mesh = new Mesh(geometry, material);
  mesh.name = "sky";
  mesh.frustumCulled = false;
  // After what is opaque, so that it costs only what it shows.
  mesh.renderOrder = 1_000;
  mesh.raycast = () => {};
  return mesh;
}
