// Another light on what was drawn: [M19] Du et al. 2019, Montage4D, section 6.2. src/vision/effects/relight.rs is its counterpart and
// specification.
#import "common/distances.wgsl"
#import "common/fullscreen.wgsl"
#import "common/srgb.wgsl"

struct Light {
    // What a white matt surface sends out by its normal: nine real spherical harmonics, linear light.
    harmonics: array<vec4<f32>, 9>,
    // Unit vectors of the picture's axes in the world.
    right: vec3<f32>,
    // 0 to 1.
    strength: f32,
    down: vec3<f32>,
    pad_down: u32,
    forward: vec3<f32>,
    pad_forward: u32,
}

@group(0) @binding(2) var colors: texture_2d<f32>;
@group(0) @binding(3) var<uniform> light: Light;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

fn sent_out(normal: vec3<f32>) -> vec3<f32> {
    let n = normal;
    var sum = light.harmonics[0].rgb * 0.2820948;
    sum += light.harmonics[1].rgb * (0.4886025 * n.y);
    sum += light.harmonics[2].rgb * (0.4886025 * n.z);
    sum += light.harmonics[3].rgb * (0.4886025 * n.x);
    sum += light.harmonics[4].rgb * (1.0925484 * n.x * n.y);
    sum += light.harmonics[5].rgb * (1.0925484 * n.y * n.z);
    sum += light.harmonics[6].rgb * (0.31539157 * (3.0 * n.z * n.z - 1.0));
    sum += light.harmonics[7].rgb * (1.0925484 * n.x * n.z);
    sum += light.harmonics[8].rgb * (0.5462742 * (n.x * n.x - n.y * n.y));
    return max(sum, vec3<f32>(0.0));
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let color = textureLoad(colors, pixel, 0);
    if distance_at(pixel) < 0.0 {
        return color;
    }
    let normal = normal_of(pixel);
    let in_world = light.right * normal.x + light.down * normal.y + light.forward * normal.z;
    let code = srgb_from_linear(clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1.0)));
    let lit = srgb_from_linear(clamp(sent_out(in_world), vec3<f32>(0.0), vec3<f32>(1.0)));
    // A power of 0 is no number on some devices; the exponent is at least one half.
    let raised = select(pow(max(code, vec3<f32>(1e-9)), 1.5 - lit), vec3<f32>(0.0), code <= vec3<f32>(0.0));
    let changed = abs(1.0 - 2.0 * lit) * (raised - code);
    let relit = clamp(code + light.strength * changed, vec3<f32>(0.0), vec3<f32>(1.0));
    return vec4<f32>(linear_from_srgb(relit), color.a);
}
