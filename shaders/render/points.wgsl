// Entities as points (early pruning, Video Fields algorithm 1): one square a foreground texel, facing the viewer.
#import "common/view.wgsl"
#import "common/camera.wgsl"

// rgb: the picture, linear light; a: the soft foreground mask.
@group(1) @binding(0) var frames: texture_2d_array<f32>;
@group(1) @binding(1) var frame_sampler: sampler;

// Texels with less foreground than this are not drawn.
const LEAST_MASK: f32 = 0.5;

struct PointIn {
    @location(0) position_from_anchor: vec3<f32>,
    @location(1) size_m: f32,
    @location(2) texture: vec2<f32>,
    @location(3) camera_idx: u32,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec3<f32>,
}

@vertex
fn vs_main(in: PointIn, @builtin(vertex_index) corner: u32) -> Varying {
    let k = in.camera_idx;
    let place = in.texture * cameras[k].frame_scale;
    let color = textureSampleLevel(frames, frame_sampler, place, cameras[k].frame_layer, 0.0);
    let x = select(-0.5, 0.5, (corner & 1u) != 0u) * in.size_m;
    let y = select(0.5, -0.5, (corner & 2u) != 0u) * in.size_m;
    let position = view.clip_from_anchor * vec4<f32>(in.position_from_anchor + view.right * x + view.down * y, 1.0);
    // Beyond infinity: clipped.
    let nowhere = vec4<f32>(0.0, 0.0, -1.0, 1.0);
    return Varying(select(nowhere, position, color.a >= LEAST_MASK), evened(k, color.rgb));
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(in.color, 1.0);
}
