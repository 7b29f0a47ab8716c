// Entities as points (early pruning, Video Fields algorithm 1): one square a foreground texel, facing the viewer. Squares
// side by side are drawn as one strip from the first to the last.
#import "common/view.wgsl"
#import "common/camera.wgsl"

// rgb: the picture, linear light; a: the soft foreground mask, which has decided already.
@group(1) @binding(0) var frames: texture_2d_array<f32>;
@group(1) @binding(1) var frame_sampler: sampler;

struct RunIn {
    // Where the first and the last stand, and the sides of their squares, metres.
    @location(0) first: vec4<f32>,
    @location(1) last: vec4<f32>,
    // Texture coordinates of the middles of the first and of the last texel.
    @location(2) textures: vec4<f32>,
    // The camera, and how many rows of texels the run stands for.
    @location(3) camera_and_rows: vec2<u32>,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) place: vec2<f32>,
    @location(1) @interpolate(flat) places: vec4<f32>,
    @location(2) @interpolate(flat) camera_idx: u32,
}

@vertex
fn vs_main(in: RunIn, @builtin(vertex_index) corner: u32) -> Varying {
    let k = in.camera_and_rows.x;
    let is_last = (corner & 1u) != 0u;
    let side = select(0.5, -0.5, (corner & 2u) != 0u);
    // The strip's direction in the picture; a run of one, or one seen from its end, lies level.
    let run = in.last.xyz - in.first.xyz;
    let along = vec2<f32>(dot(run, view.right), dot(run, view.down));
    let length_m = length(along);
    let ahead = select(vec2<f32>(1.0, 0.0), along / length_m, length_m > 1e-6 * in.first.w);
    let end = select(in.first, in.last, is_last);
    let beyond = select(-0.5, 0.5, is_last) * end.w;
    let beside = side * end.w * f32(in.camera_and_rows.y);
    let in_picture = ahead * beyond + vec2<f32>(-ahead.y, ahead.x) * beside;
    let position = end.xyz + view.right * in_picture.x + view.down * in_picture.y;
    let places = in.textures * vec4<f32>(cameras[k].frame_scale, cameras[k].frame_scale);
    let place = select(places.xy, places.zw, is_last);
    return Varying(view.clip_from_anchor * vec4<f32>(position, 1.0), place, places, k);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    // No farther than the outer texels' middles: beyond lies background.
    let place = clamp(in.place, min(in.places.xy, in.places.zw), max(in.places.xy, in.places.zw));
    let color = textureSampleLevel(frames, frame_sampler, place, cameras[in.camera_idx].frame_layer, 0.0);
    return vec4<f32>(evened(in.camera_idx, color.rgb), 1.0);
}
