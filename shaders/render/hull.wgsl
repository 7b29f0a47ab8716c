// Hulls as they are shown: the surface that a method found, textured fragment by fragment from all cameras that see it, W = V Wf Ws Wd
// (hybrid 2004, sections 4.3 and 4.4).
#import "common/hull_faces.wgsl"
#import "common/fullscreen.wgsl"

// rgb: the picture, linear light; a: the soft foreground mask.
@group(1) @binding(0) var frames: texture_2d_array<f32>;
@group(1) @binding(1) var frame_sampler: sampler;
@group(3) @binding(0) var surface: texture_2d<u32>;
// What every camera sees of the hulls.
@group(3) @binding(1) var reference: texture_depth_2d;

// How cameras are found before whom another part of a hull stands: not at all, by their depth maps, by rays.
const VISIBLE_OFF: u32 = 0u;
const VISIBLE_DEPTHS: u32 = 1u;
const VISIBLE_RAYS: u32 = 2u;
override VISIBILITY: u32 = 2u;
// Whether obliqueness and direction are weighed at the corners of faces, not at the fragment.
override AT_CORNERS: bool = false;
// Whether weights fall off towards the silhouettes' outlines.
override HAS_FEATHER: bool = true;

// Exponents of obliqueness and of likeness of direction.
const ALPHA: f32 = 5.0;
const BETA: f32 = 5.0;
// Pixels of a camera's picture within an outline that count for nothing, and over which it then comes to count in full.
const BORDER_PX: f32 = 1.0;
const FEATHER_PX: f32 = 4.0;
// Share by which outlines count where nothing else is seen.
const LEAST_SHARE: f32 = 1e-3;
// Metres by which a surface may lie behind what a camera sees, for it to be the same.
const SAME_M: f32 = 0.04;
// Weights below have no say: what they are of falls back on the next in order.
const LEAST_WEIGHT: f32 = 1e-5;

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

// Whether anything of the hulls lies between a view's camera and a place on one of them.
fn is_hidden(view_idx: u32, own: u32, place: vec3<f32>) -> bool {
    let eye = eye_of(view_idx);
    let way = place - eye;
    let distance = length(way);
    let direction = way / max(distance, 1e-9);
    let until = distance - SAME_M;
    for (var hull_idx = 0u; hull_idx < hull_frame.n_hulls; hull_idx++) {
        let range = within_bounds(hull_idx, HullRay(eye, direction));
        let first = max(range.x, 0.0);
        let last = min(range.y, until);
        if first >= last {
            continue;
        }
        let near = HullRay(eye + direction * first, direction);
        // Along its own rays a camera's silhouette says nothing.
        let but = select(NO_VIEW, view_idx, hull_idx == own);
        if hull_hit(hull_idx, near, vec2<f32>(0.0, last - first), but).is_hit {
            return true;
        }
    }
    return false;
}

// Whether a camera's depth map has something else of the hulls before a place, which is given in the camera's axes.
fn is_behind_reference(view_idx: u32, local: vec3<f32>) -> bool {
    let scale = hull_views[view_idx].tile_scale;
    let share = local.xy / local.z * scale + hull_views[view_idx].tile_offset;
    if scale.x == 0.0 || any(share < vec2<f32>(0.0)) || any(share >= vec2<f32>(1.0)) {
        return false;
    }
    let columns = hull_frame.tile_columns;
    let side = i32(textureDimensions(reference).x / max(columns, 1u));
    let first = vec2<i32>(vec2<u32>(view_idx % max(columns, 1u), view_idx / max(columns, 1u))) * side;
    let low = vec2<i32>(floor(share * f32(side) - 0.5));
    // The farthest of the four around: where the map is seen edge-on, its texels lie far apart.
    var farthest = 1.0;
    for (var i = 0; i < 4; i++) {
        let at = clamp(low + vec2<i32>(i & 1, i >> 1u), vec2<i32>(0), vec2<i32>(side - 1));
        farthest = min(farthest, textureLoad(reference, first + at, 0));
    }
    return farthest > 0.0 && local.z > CAMERA_NEAR_M / max(farthest, 1e-9) + SAME_M;
}

// How much a view's camera counts for a place by how much as the viewer it sees it (x), and by how obliquely (y).
fn leanings(view_idx: u32, place: vec3<f32>, normal: vec3<f32>) -> vec2<f32> {
    let to_camera = normalize(eye_of(view_idx) - place);
    let likeness = 0.5 * (dot(to_camera, to_viewer_from(place)) + 1.0);
    return vec2<f32>(pow(max(likeness, 1e-4), BETA), pow(max(dot(to_camera, normal), 0.0), ALPHA));
}

// Where on a face a place lies, as shares between its corners; and which view's face it is.
struct OnFace {
    face: vec3<u32>,
    share: vec2<f32>,
}

fn on_face(hull_idx: u32, edge_idx: u32, place: vec3<f32>) -> OnFace {
    let first = hulls[hull_idx].first_view;
    var view_idx = first;
    for (var k = 1u; k < hulls[hull_idx].n_views; k++) {
        if hull_views[first + k].first_edge <= edge_idx && hull_views[first + k].n_leaves > 0u {
            view_idx = first + k;
        }
    }
    let camera_idx = hull_views[view_idx].camera_idx;
    let from_anchor = vec4<f32>(place - hull_views[view_idx].shift, 1.0);
    let z = dot(cameras[camera_idx].row_z, from_anchor);
    let at = vec2<f32>(dot(cameras[camera_idx].row_x, from_anchor), dot(cameras[camera_idx].row_y, from_anchor)) / z;
    let edge = hull_edges[edge_idx];
    let way = edge.zw - edge.xy;
    let reach = reach_of(hull_idx, view_idx);
    let share = vec2<f32>(
        dot(at - edge.xy, way) / max(dot(way, way), 1e-20), (z - reach.x) / max(reach.y - reach.x, 1e-6),
    );
    return OnFace(vec3<u32>(hull_idx, view_idx, edge_idx), clamp(share, vec2<f32>(0.0), vec2<f32>(1.0)));
}

// The same, worked out at the corners of the face and in between as a rasteriser would have it.
fn leaning_between(view_idx: u32, on: OnFace, normal: vec3<f32>) -> f32 {
    var at: vec4<f32>;
    for (var corner = 0u; corner < 4u; corner++) {
        let lean_of = leanings(view_idx, face_corner(corner, on.face), normal);
        at[corner] = lean_of.x * lean_of.y;
    }
    return mix(mix(at.x, at.y, on.share.x), mix(at.z, at.w, on.share.x), on.share.y);
}

struct Shown {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> Shown {
    let texel = textureLoad(surface, vec2<u32>(position.xy), 0);
    if texel.z == 0u {
        discard;
    }
    let found = unpacked_surface(texel);
    let ray = hull_ray(position.xy);
    let place = ray.origin + ray.direction * found.t;
    let is_at_corners = AT_CORNERS && found.edge != NO_EDGE;
    var on = OnFace(vec3<u32>(0u), vec2<f32>(0.0));
    if is_at_corners {
        on = on_face(found.hull_idx, found.edge, place);
    }
    let first = hulls[found.hull_idx].first_view;
    // By all four weights; and, for what nobody sees well, as what lies before it is seen from the viewer's side: filled from beside,
    // away from outlines where there is more than that.
    var sums = array<vec4<f32>, 2>(vec4<f32>(0.0), vec4<f32>(0.0));
    for (var k = 0u; k < hulls[found.hull_idx].n_views; k++) {
        let view_idx = first + k;
        let camera_idx = hull_views[view_idx].camera_idx;
        let seen = seen_by(view_idx, place);
        if !seen.is_seen || any(seen.texture < vec2<f32>(0.0)) || any(seen.texture > vec2<f32>(1.0)) {
            continue;
        }
        let at = seen.texture * cameras[camera_idx].frame_scale;
        let color = textureSampleLevel(frames, frame_sampler, at, cameras[camera_idx].frame_layer, 0.0);
        let lean_of = leanings(view_idx, place, found.normal);
        let within = silhouette_texel(view_idx, place).x + 0.5;
        // What shows the background is not of its colour; pixels on the outline are of both.
        let is_own = smoothstep(0.25, 0.75, color.a);
        let share = clamp((within - BORDER_PX) / FEATHER_PX, 0.0, 1.0);
        let feather = select(is_own, is_own * share, HAS_FEATHER);
        var lean = lean_of.x * lean_of.y;
        if is_at_corners {
            lean = leaning_between(view_idx, on, found.normal);
        }
        var weight = feather * lean;
        let rgb = evened(camera_idx, color.rgb);
        sums[1] += vec4<f32>(rgb, 1.0) * (is_own * max(share * share, LEAST_SHARE) * lean_of.x);
        if VISIBILITY == VISIBLE_RAYS && weight > LEAST_WEIGHT {
            if is_hidden(view_idx, found.hull_idx, place) {
                weight = 0.0;
            }
        } else if VISIBILITY == VISIBLE_DEPTHS && is_behind_reference(view_idx, seen.local) {
            weight = 0.0;
        }
        sums[0] += vec4<f32>(rgb, 1.0) * weight;
    }
    var sum = sums[0];
    if sum.a <= LEAST_WEIGHT {
        sum = sums[1];
    }
    // What no camera has a foreground for is nobody.
    if sum.a <= 0.0 {
        discard;
    }
    let alpha = found.coverage;
    if alpha <= 0.0 {
        discard;
    }
    let clip = view.clip_from_anchor * vec4<f32>(place, 1.0);
    return Shown(vec4<f32>(sum.rgb / sum.a * alpha, alpha), clamp(clip.z / clip.w, 0.0, 1.0));
}
