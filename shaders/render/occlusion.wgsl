// Light that is taken away where much stands around: [M12] McGuire, Mara, Luebke 2012, Scalable ambient obscurance.
// src/vision/effects/occlusion.rs is its counterpart and specification.
#import "common/distances.wgsl"
#import "common/fullscreen.wgsl"

struct Occlusion {
    radius_m: f32,
    strength: f32,
    // What bounds the radius: a tangent, of parallel rays metres.
    most: f32,
    pad: u32,
    // Two places on the unit disc each.
    taps: array<vec4<f32>, 6>,
    // Two turns (cosine, sine) each, 4 x 4 of them.
    rotations: array<vec4<f32>, 8>,
}

@group(0) @binding(2) var colors: texture_2d<f32>;
@group(0) @binding(3) var<uniform> occlusion: Occlusion;
// The share of light that reaches each pixel.
@group(0) @binding(4) var open: texture_2d<f32>;

const N_TAPS: u32 = 12u;
const BIAS: f32 = 0.02;
const NEAREST: f32 = 0.01;
const GAIN: f32 = 4.5;
const SAME_PLANE: f32 = 0.1;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

fn radius_at(beyond_m: f32) -> f32 {
    return min(occlusion.radius_m, occlusion.most * depth_of(beyond_m));
}

fn half_of(pair: vec4<f32>, idx: u32) -> vec2<f32> {
    return select(pair.xy, pair.zw, (idx & 1u) != 0u);
}

@fragment
fn fs_open(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let beyond_m = distance_at(pixel);
    if beyond_m < 0.0 {
        return vec4<f32>(1.0);
    }
    let radius_m = radius_at(beyond_m);
    let reach_px = vec2<f32>(radius_m / depth_of(beyond_m)) / lens.pitch;
    if max(reach_px.x, reach_px.y) < 1.0 {
        return vec4<f32>(1.0);
    }
    let place = place_of(pixel, beyond_m);
    let normal = normal_of(pixel);
    let anchored = pixel + lens.anchor;
    let which = u32((anchored.y & 3) * 4 + (anchored.x & 3));
    let turn = half_of(occlusion.rotations[which / 2u], which);
    let middle = vec2<f32>(pixel) + 0.5;
    var sum = 0.0;
    for (var idx = 0u; idx < N_TAPS; idx++) {
        let tap = half_of(occlusion.taps[idx / 2u], idx);
        let turned = vec2<f32>(tap.x * turn.x - tap.y * turn.y, tap.x * turn.y + tap.y * turn.x);
        let at = vec2<i32>(floor(middle + turned * reach_px));
        let there_m = distance_at(at);
        if there_m < 0.0 {
            continue;
        }
        let way = (place_of(at, there_m) - place) / radius_m;
        let squared = dot(way, way);
        let falling = max(1.0 - squared, 0.0);
        sum += falling * falling * falling * max(dot(way, normal) - BIAS, 0.0) / (squared + NEAREST);
    }
    return vec4<f32>(max(1.0 - occlusion.strength * GAIN * sum / f32(N_TAPS), 0.0));
}

// The mean of what lies in the pixel's plane among 4 x 4: one of each turn.
fn smoothed(pixel: vec2<i32>) -> f32 {
    let beyond_m = distance_at(pixel);
    if beyond_m < 0.0 {
        return 1.0;
    }
    let reach = SAME_PLANE * radius_at(beyond_m);
    let place = place_of(pixel, beyond_m);
    let normal = normal_of(pixel);
    var sum = 0.0;
    var weights = 0.0;
    for (var y = -2; y <= 1; y++) {
        for (var x = -2; x <= 1; x++) {
            let at = pixel + vec2<i32>(x, y);
            let there_m = distance_at(at);
            if there_m < 0.0 {
                continue;
            }
            let off = abs(dot(place_of(at, there_m) - place, normal));
            let weight = max(1.0 - off / reach, 0.0);
            sum += weight * textureLoad(open, at, 0).r;
            weights += weight;
        }
    }
    return sum / max(weights, 1e-6);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let color = textureLoad(colors, pixel, 0);
    return vec4<f32>(color.rgb * smoothed(pixel), color.a);
}
