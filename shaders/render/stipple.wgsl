// Dots on paper: [M19] Du et al. 2019, Montage4D, section 6.1. src/vision/effects/stipple.rs is its counterpart and specification.
#import "common/fullscreen.wgsl"
#import "common/srgb.wgsl"

struct Stipple {
    // What the upper left pixel is called in all of the picture.
    anchor: vec2<i32>,
    dot_px: i32,
    blur_px: f32,
    contrast: f32,
    shade: f32,
    pad: vec2<u32>,
}

@group(0) @binding(0) var colors: texture_2d<f32>;
@group(0) @binding(1) var<uniform> stipple: Stipple;

const LUMA: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

// Three numbers from 0 to below 1 that follow from a cell alone: PCG3D, [JO20] Jarzynski and Olano 2020.
fn random(cell: vec2<i32>) -> vec3<f32> {
    var v = vec3<u32>(bitcast<vec2<u32>>(cell), 0u) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec3<f32>(v >> vec3<u32>(8u)) / 16777216.0;
}

fn floor_divided(value: i32, by: i32) -> i32 {
    let quotient = value / by;
    return select(quotient, quotient - 1, value % by < 0);
}

fn code_of(color: vec3<f32>) -> vec3<f32> {
    return srgb_from_linear(clamp(color, vec3<f32>(0.0), vec3<f32>(1.0)));
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let anchored = pixel + stipple.anchor;
    let cell = vec2<i32>(floor_divided(anchored.x, stipple.dot_px), floor_divided(anchored.y, stipple.dot_px));
    let chance = random(cell);
    // Evenly from the square, bent to the disc without an angle.
    let square = chance.xy * 2.0 - 1.0;
    let disc = square * max(vec2<f32>(1.0) - 0.5 * square.yx * square.yx, vec2<f32>(0.0));
    let offset = vec2<i32>(floor(disc * stipple.blur_px + 0.5));
    let most = vec2<i32>(textureDimensions(colors)) - 1;
    let beside_pixel = clamp(pixel + offset, vec2<i32>(0), most);
    let own = code_of(textureLoad(colors, pixel, 0).rgb);
    let beside = code_of(textureLoad(colors, beside_pixel, 0).rgb);
    // Colour dodge by the inverse of what is beside; of black on black what is flat is: paper.
    let dodged = select(own / max(beside, vec3<f32>(1e-9)), vec3<f32>(1.0), own >= beside);
    let brightness = clamp(dot(dodged, LUMA), 0.0, 1.0);
    let raised = select(pow(max(brightness, 1e-9), stipple.contrast), 0.0, brightness <= 0.0);
    let dark = max(1.0 - dot(own, LUMA), 0.0);
    let grey = select(raised, 0.0, chance.z < stipple.shade * dark * dark);
    return vec4<f32>(linear_from_srgb(vec3<f32>(grey)), 1.0);
}
