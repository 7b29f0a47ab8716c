// Entities as upright rectangles (deferred pruning, Video Fields algorithm 2): every fragment projects the world
// point of its rectangle into the camera that saw the entity, and shows what is foreground there.
#import "common/view.wgsl"
#import "common/camera.wgsl"

// rgb: the picture, linear light; a: the soft foreground mask.
@group(1) @binding(0) var frames: texture_2d_array<f32>;
@group(1) @binding(1) var frame_sampler: sampler;

// Foreground share that begins to show, and that shows in full: the outermost of a soft edge is background.
const LEAST_MASK: f32 = 0.2;
const FULL_MASK: f32 = 0.8;
// Pixels around the blob's rectangle over which it fades out.
const RECT_FEATHER_PX: f32 = 2.0;

struct BillboardIn {
    @location(0) foot_from_anchor: vec3<f32>,
    @location(1) camera_idx: u32,
    // Unit vector along the base line as the camera saw it.
    @location(2) right: vec3<f32>,
    @location(3) height_m: f32,
    // Unit vectors along the base line and the sides as they are turned towards the viewer.
    @location(4) turned_right: vec3<f32>,
    @location(5) turned_up: vec3<f32>,
    // Blob's rectangle: u, v of its upper left and lower right.
    @location(6) rect: vec4<f32>,
    // Extent along the base line to the left (negative) and right edge, metres.
    @location(7) left_right_m: vec2<f32>,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    // The point of the rectangle before it was turned: where it is looked up.
    @location(0) seen_from_anchor: vec3<f32>,
    @location(1) @interpolate(flat) camera_idx: u32,
    @location(2) @interpolate(flat) rect: vec4<f32>,
}

@vertex
fn vs_main(in: BillboardIn, @builtin(vertex_index) corner: u32) -> Varying {
    let along = select(in.left_right_m.x, in.left_right_m.y, (corner & 1u) != 0u);
    let up = select(0.0, in.height_m, (corner & 2u) != 0u);
    let drawn = in.foot_from_anchor + in.turned_right * along + in.turned_up * up;
    let seen = in.foot_from_anchor + in.right * along + vec3<f32>(0.0, 0.0, up);
    return Varying(view.clip_from_anchor * vec4<f32>(drawn, 1.0), seen, in.camera_idx, in.rect);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    let k = in.camera_idx;
    let projection = project(k, in.seen_from_anchor);
    let texture = clamp(projection.texture, vec2<f32>(0.0), vec2<f32>(1.0));
    let color = textureSampleLevel(frames, frame_sampler, texture * cameras[k].frame_scale, cameras[k].frame_layer, 0.0);
    let beside = max(max(in.rect.xy - projection.texture, projection.texture - in.rect.zw), vec2<f32>(0.0));
    let beside_px = beside * cameras[k].frame_size_px;
    let inside = 1.0 - smoothstep(0.0, RECT_FEATHER_PX, max(beside_px.x, beside_px.y));
    let alpha = smoothstep(LEAST_MASK, FULL_MASK, color.a) * inside;
    let is_shown = projection.is_seen && alpha > 0.0;
    if !is_shown {
        discard;
    }
    return vec4<f32>(color.rgb * alpha, alpha);
}
