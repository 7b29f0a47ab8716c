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

// Whether any rectangle shows a second source: a variant without looks none up.
override HAS_BESIDE: bool = true;
// Says that people are told apart in some camera's picture: a variant without asks for no pixel's owner.
override HAS_OWNERS: bool = true;

// Owners of what moves: for each camera the word at which its cells begin, cells in a row, rows, and their sides in pixels (0 where
// nobody is told apart); then cells, two a word. src/render/owner_data.rs is its counterpart.
@group(2) @binding(0) var<storage, read> owner_words: array<u32>;

// Share of a place's surroundings that must be the entity's to begin to show, and to show in full.
const LEAST_OWNED: f32 = 0.3;
const FULL_OWNED: f32 = 0.7;

struct BillboardIn {
    // Where the entity stands.
    @location(0) foot_from_anchor: vec3<f32>,
    @location(1) camera_idx: u32,
    // Unit vector along the base line as the camera saw it.
    @location(2) right: vec3<f32>,
    @location(3) height_m: f32,
    // Unit vectors along the base line and the sides as they are turned towards the viewer.
    @location(4) turned_right: vec3<f32>,
    @location(5) turned_up: vec3<f32>,
    // Where the camera alone saw it stand: where it is looked up.
    @location(13) seen_foot: vec3<f32>,
    // Blob's rectangle: u, v of its upper left and lower right.
    @location(6) rect: vec4<f32>,
    // Extent along the base line to the left (negative) and right edge, metres.
    @location(7) left_right_m: vec2<f32>,
    // The second source: where it is looked up, and its share of the whole.
    @location(8) beside_foot: vec3<f32>,
    @location(9) beside_camera_idx: u32,
    @location(10) beside_right: vec3<f32>,
    @location(11) beside_weight: f32,
    @location(12) beside_rect: vec4<f32>,
    // Numbers of whom the first and the second source show, 0 of what is nobody's.
    @location(14) owners: vec2<u32>,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    // The point of the rectangle before it was turned: where it is looked up.
    @location(0) seen_from_anchor: vec3<f32>,
    @location(1) @interpolate(flat) camera_idx: u32,
    @location(2) @interpolate(flat) rect: vec4<f32>,
    @location(3) beside_from_anchor: vec3<f32>,
    @location(4) @interpolate(flat) beside_camera_idx: u32,
    @location(5) @interpolate(flat) beside_rect: vec4<f32>,
    @location(6) @interpolate(flat) beside_weight: f32,
    @location(7) @interpolate(flat) owners: vec2<u32>,
}

@vertex
fn vs_main(in: BillboardIn, @builtin(vertex_index) corner: u32) -> Varying {
    let along = select(in.left_right_m.x, in.left_right_m.y, (corner & 1u) != 0u);
    let up = select(0.0, in.height_m, (corner & 2u) != 0u);
    let drawn = in.foot_from_anchor + in.turned_right * along + in.turned_up * up;
    let upright = vec3<f32>(0.0, 0.0, up);
    let seen = in.seen_foot + in.right * along + upright;
    let beside = in.beside_foot + in.beside_right * along + upright;
    return Varying(
        view.clip_from_anchor * vec4<f32>(drawn, 1.0), seen, in.camera_idx, in.rect, beside, in.beside_camera_idx,
        in.beside_rect, in.beside_weight, in.owners,
    );
}

// Returns 1 where a cell is the owner's, 0 elsewhere.
fn cell_share(header: vec4<u32>, cell: vec2<i32>, owner: u32) -> f32 {
    let at = vec2<u32>(clamp(cell, vec2<i32>(0), vec2<i32>(header.yz) - 1));
    let idx = at.y * header.y + at.x;
    let number = (owner_words[header.x + idx / 2u] >> (16u * (idx & 1u))) & 0xffffu;
    return select(0.0, 1.0, number == owner);
}

// Returns the share of a place in a camera's picture that is the owner's, 0 to 1: between the middles of four cells.
fn owned_share(camera_idx: u32, texture: vec2<f32>, owner: u32) -> f32 {
    let first = camera_idx * 4u;
    let header = vec4<u32>(
        owner_words[first], owner_words[first + 1u], owner_words[first + 2u], owner_words[first + 3u],
    );
    if header.w == 0u {
        return 1.0;
    }
    let place = texture * cameras[camera_idx].frame_size_px / f32(header.w) - 0.5;
    let low = floor(place);
    let share = place - low;
    let cell = vec2<i32>(low);
    let upper = mix(cell_share(header, cell, owner), cell_share(header, cell + vec2<i32>(1, 0), owner), share.x);
    let below = cell + vec2<i32>(0, 1);
    let lower = mix(cell_share(header, below, owner), cell_share(header, below + vec2<i32>(1, 0), owner), share.x);
    return smoothstep(LEAST_OWNED, FULL_OWNED, mix(upper, lower, share.y));
}

// Returns the colour that a camera shows of the entity at a point, premultiplied by the share of it that is the entity's.
fn entity_color(camera_idx: u32, point_from_anchor: vec3<f32>, rect: vec4<f32>, owner: u32) -> vec4<f32> {
    let projection = project(camera_idx, point_from_anchor);
    let texture = clamp(projection.texture, vec2<f32>(0.0), vec2<f32>(1.0));
    let place = texture * cameras[camera_idx].frame_scale;
    let color = textureSampleLevel(frames, frame_sampler, place, cameras[camera_idx].frame_layer, 0.0);
    let beside = max(max(rect.xy - projection.texture, projection.texture - rect.zw), vec2<f32>(0.0));
    let beside_px = beside * cameras[camera_idx].frame_size_px;
    let inside = 1.0 - smoothstep(0.0, RECT_FEATHER_PX, max(beside_px.x, beside_px.y));
    var alpha = select(0.0, smoothstep(LEAST_MASK, FULL_MASK, color.a) * inside, projection.is_seen);
    if HAS_OWNERS && alpha > 0.0 {
        alpha *= owned_share(camera_idx, texture, owner);
    }
    return vec4<f32>(evened(camera_idx, color.rgb) * alpha, alpha);
}

// Two sources of one entity are mixed before they cover anything. Where both show it, it is as opaque as by one; what one
// alone shows is as opaque as that if it has half of the weight or more, and fades with less.
fn mixed(in: Varying) -> vec4<f32> {
    var color = entity_color(in.camera_idx, in.seen_from_anchor, in.rect, in.owners.x);
    if HAS_BESIDE {
        let beside = entity_color(in.beside_camera_idx, in.beside_from_anchor, in.beside_rect, in.owners.y);
        let weights = vec2<f32>(1.0 - in.beside_weight, in.beside_weight);
        let claims = vec2<f32>(color.a, beside.a) * min(2.0 * weights, vec2<f32>(1.0));
        let sum = color * weights.x + beside * weights.y;
        let alpha = max(claims.x, claims.y);
        color = vec4<f32>(sum.rgb * (alpha / max(sum.a, 1e-6)), alpha);
    }
    return color;
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    let color = mixed(in);
    if color.a <= 0.0 {
        discard;
    }
    return color;
}

// Of what shows more than half, the depth alone.
@fragment
fn fs_depth(in: Varying) -> @location(0) vec4<f32> {
    let color = mixed(in);
    if color.a < 0.5 {
        discard;
    }
    return color;
}
