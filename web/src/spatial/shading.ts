// What surfaces look like: their own colour or picture, lit a little so that solids read as such (src/render/mesh.rs), and what
// cameras' pictures add to it (`projection.ts`). All surfaces of a scene share one set of uniforms and switches.

import { Color, DoubleSide, FrontSide, GLSL3, ShaderMaterial, type IUniform, type Texture, Vector4 } from "three";
import { PROJECTION_GLSL } from "./projectionShader";

export type Look = {
  readonly color: Color;
  readonly map?: Texture | null;
  /** Whether the plain colour shows beyond the picture, else it repeats. */
  readonly ends?: boolean;
  /** Whether the picture is multiplied by the colour, as glTF's are. */
  readonly isTinted?: boolean;
  readonly hasColors?: boolean;
  /** How many surfaces lie below it in its plane: later ones are seen. */
  readonly rank?: number;
  readonly isOpen?: boolean;
};

const VERTEX = /* glsl */ `
in vec3 coord;
#ifdef HAS_COLORS
in vec3 tone;
out vec3 vTone;
#endif
centroid out vec3 vPoint;
out vec3 vNormal;
centroid out vec3 vCoord;
void main() {
  vec4 three = modelMatrix * vec4(position, 1.0);
  // three.js's axes back to the world's.
  vPoint = vec3(three.x, -three.z, three.y);
  vec3 turned = mat3(modelMatrix) * normal;
  vNormal = vec3(turned.x, -turned.z, turned.y);
  vCoord = coord;
  #ifdef HAS_COLORS
  vTone = tone;
  #endif
  gl_Position = projectionMatrix * viewMatrix * three;
}
`;

const FRAGMENT = /* glsl */ `
layout(location = 0) out highp vec4 pc_fragColor;
#define gl_FragColor pc_fragColor
uniform vec3 color;
uniform float opacity;
uniform vec4 glow;
centroid in vec3 vPoint;
in vec3 vNormal;
centroid in vec3 vCoord;
#ifdef HAS_MAP
uniform sampler2D map;
#endif
#ifdef HAS_COLORS
in vec3 vTone;
#endif

float lit(vec3 normal) {
  return min(0.6 + 0.4 * max(dot(normal, vec3(-0.36, -0.48, 0.8)), 0.0) / 0.8, 1.0);
}
${PROJECTION_GLSL}
void main() {
  vec3 normal = normalize(vNormal);
  vec3 own = color;
  #ifdef HAS_COLORS
  own *= vTone;
  #endif
  vec3 material = own * lit(normal);
  #ifdef HAS_MAP
  vec2 place = vCoord.xy / (vCoord.z > 1e-6 ? vCoord.z : 1.0);
  vec4 shown = texture(map, place);
  bool isWithin = vCoord.z > 1e-6 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThanEqual(place, vec2(1.0)));
  #ifndef MAP_ENDS
  isWithin = true;
  #endif
  #ifdef MAP_TINTED
  shown.rgb *= own;
  #endif
  if (isWithin) material = mix(material, shown.rgb * lit(normal), shown.a);
  #endif
  vec3 final = material;
  #if N_LENSES > 0
  final = projected(vPoint, normal, material);
  #endif
  final = mix(final, glow.rgb, glow.a);
  gl_FragColor = vec4(final, opacity);
  #include <colorspace_fragment>
}
`;

/** What one scene's materials have in common. */
export class Shading {
  readonly uniforms: Record<string, IUniform> = {};
  private readonly defines: Record<string, unknown> = { N_LENSES: 0 };
  private readonly materials = new Set<ShaderMaterial>();

  /** Sets switches of all materials (null: none), which are compiled anew if that changes anything. */
  define(defines: Record<string, string | number | null>): void {
    const changed = Object.entries(defines).filter(([name, value]) => (this.defines[name] ?? null) !== value);
    if (changed.length === 0) return;
    for (const [name, value] of changed) {
      for (const all of [this.defines, ...[...this.materials].map((material) => material.defines)]) {
        if (value === null) Reflect.deleteProperty(all, name);
        else all[name] = value;
      }
    }
    for (const material of this.materials) material.needsUpdate = true;
  }

  /** Adds uniforms to those that all materials share; materials that are there already take them too. */
  share(uniforms: Record<string, IUniform>): void {
    for (const [name, uniform] of Object.entries(uniforms)) {
      const value: unknown = uniform.value;
      const shared = this.uniforms[name];
      if (shared) shared.value = value;
      else {
        const made: IUniform = { value };
        this.uniforms[name] = made;
        for (const material of this.materials) material.uniforms[name] = made;
      }
    }
  }

  material(look: Look): ShaderMaterial {
    const { color, map = null, ends = false, isTinted = false, hasColors = false, rank = 0, isOpen = false } = look;
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: isOpen ? DoubleSide : FrontSide,
      polygonOffset: rank > 0,
      polygonOffsetFactor: -0.1 * rank,
      polygonOffsetUnits: -4 * rank,
      defines: {
        ...this.defines,
        ...(map ? { HAS_MAP: 1 } : {}),
        ...(map && ends ? { MAP_ENDS: 1 } : {}),
        ...(map && isTinted ? { MAP_TINTED: 1 } : {}),
        ...(hasColors ? { HAS_COLORS: 1 } : {}),
      },
    });
    material.uniforms = {
      ...this.uniforms,
      color: { value: color },
      map: { value: map },
      opacity: { value: 1 },
      glow: { value: new Vector4() },
    };
    this.materials.add(material);
    material.addEventListener("dispose", () => this.materials.delete(material));
    return material;
  }
}
