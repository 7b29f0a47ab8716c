// A coarse picture enlarged, bilinearly and in linear light.
#import "common/fullscreen.wgsl"

@group(0) @binding(0) var coarse: texture_2d<f32>;
@group(0) @binding(1) var coarse_sampler: sampler;

// Pixels each way that one becomes.
override TIMES: f32 = 2.0;
// Pixels of the coarse picture that lie left of and above what is shown.
override MARGIN_PX: f32 = 1.0;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let place = (position.xy / TIMES + MARGIN_PX) / vec2<f32>(textureDimensions(coarse));
    return vec4<f32>(textureSampleLevel(coarse, coarse_sampler, place, 0.0).rgb, 1.0);
}
