// Several pixels each way of a finer picture averaged into one, in linear light.
#import "common/fullscreen.wgsl"

@group(0) @binding(0) var finer: texture_2d<f32>;

// Pixels each way that make one.
override TIMES: u32 = 2u;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let corner = vec2<u32>(position.xy) * TIMES;
    var sum = vec3<f32>(0.0);
    for (var y = 0u; y < TIMES; y++) {
        for (var x = 0u; x < TIMES; x++) {
            sum += textureLoad(finer, corner + vec2<u32>(x, y), 0).rgb;
        }
    }
    return vec4<f32>(sum / f32(TIMES * TIMES), 1.0);
}
