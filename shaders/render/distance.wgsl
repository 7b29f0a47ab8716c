// How far what was drawn lies: one number a pixel, of several samples the nearest's.
#import "common/distances.wgsl"
#import "common/fullscreen.wgsl"

@group(0) @binding(2) var depths: texture_depth_2d;
@group(0) @binding(3) var depth_samples: texture_depth_multisampled_2d;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

fn beyond(depth: f32) -> f32 {
    if depth <= 0.0 {
        return NOTHING_M;
    }
    let through_eye = lens.scale * (1.0 - depth) / (depth + lens.falling);
    return max(select(through_eye, lens.scale * (1.0 - depth), lens.is_parallel != 0u), 0.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(beyond(textureLoad(depths, vec2<i32>(position.xy), 0)), 0.0, 0.0, 0.0);
}

@fragment
fn fs_samples(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    var nearest = 0.0;
    for (var idx = 0; idx < i32(textureNumSamples(depth_samples)); idx++) {
        nearest = max(nearest, textureLoad(depth_samples, pixel, idx));
    }
    return vec4<f32>(beyond(nearest), 0.0, 0.0, 0.0);
}
