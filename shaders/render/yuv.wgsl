// From the decoder's planes to one layer of sRGB pictures, and from there to its smaller levels.
#import "common/color.wgsl"
#import "common/fullscreen.wgsl"

struct Conversion {
    row_r: vec3<f32>,
    layer: u32,
    row_g: vec3<f32>,
    has_mask: u32,
    row_b: vec3<f32>,
    pad: u32,
    // Subtracted from samples in 0 to 1, then multiplied.
    offset: vec3<f32>,
    width_px: u32,
    gain: vec3<f32>,
    height_px: u32,
}

@group(1) @binding(0) var<storage, read> conversions: array<Conversion>;
@group(1) @binding(1) var luma_planes: texture_2d_array<f32>;
@group(1) @binding(2) var u_planes: texture_2d_array<f32>;
@group(1) @binding(3) var v_planes: texture_2d_array<f32>;
@group(1) @binding(4) var mask_planes: texture_2d_array<f32>;
@group(2) @binding(0) var finer_level: texture_2d<f32>;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) conversion_idx: u32,
}

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32, @builtin(instance_index) conversion_idx: u32) -> Varying {
    return Varying(fullscreen_position(vertex_idx), conversion_idx);
}

// Beyond the picture its border repeats, so that neither filtering nor smaller levels mix in a stranger.
@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    let job = conversions[in.conversion_idx];
    let texel = min(vec2<u32>(in.position.xy), vec2<u32>(job.width_px, job.height_px) - 1u);
    let layer = job.layer;
    let yuv = vec3<f32>(
        textureLoad(luma_planes, texel, layer, 0).r,
        textureLoad(u_planes, texel / 2u, layer, 0).r,
        textureLoad(v_planes, texel / 2u, layer, 0).r,
    );
    var alpha = 1.0;
    if job.has_mask != 0u {
        alpha = textureLoad(mask_planes, texel, layer, 0).r;
    }
    return vec4<f32>(srgb_from_yuv(yuv, job.offset, job.gain, job.row_r, job.row_g, job.row_b), alpha);
}

// The mean of 2 x 2 texels, in linear light: views of the levels decode and encode sRGB.
@fragment
fn fs_smaller(in: Varying) -> @location(0) vec4<f32> {
    let corner = vec2<u32>(in.position.xy) * 2u;
    let upper = textureLoad(finer_level, corner, 0) + textureLoad(finer_level, corner + vec2<u32>(1u, 0u), 0);
    let lower = textureLoad(finer_level, corner + vec2<u32>(0u, 1u), 0)
        + textureLoad(finer_level, corner + vec2<u32>(1u, 1u), 0);
    return (upper + lower) * 0.25;
}
