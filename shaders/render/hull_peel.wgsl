// Hulls by constructive solid geometry on depths (Li, Magnor and Seidel 2004, Hybrid Hardware-Accelerated Algorithm for High Quality
// Rendering of Visual Hulls): layer after layer of the cones' faces is peeled off, and a layer is the hull's where no cone that takes
// away holds what lies just behind it. That is counted from infinity, on closed cones, so that an eye within some is as good as any.
#import "common/hull_faces.wgsl"
#import "common/fullscreen.wgsl"

// The layer before, or the one that is counted behind; and what is found already.
@group(1) @binding(0) var layer_depth: texture_depth_2d;
@group(1) @binding(1) var found_depth: texture_depth_2d;
// Where there may be a hull at all, coarsely.
@group(3) @binding(4) var valid: texture_2d<u32>;
// What a layer is of, and how many cones take away what is behind it.
@group(3) @binding(0) var layer: texture_2d<u32>;
@group(3) @binding(1) var count: texture_2d<f32>;
// Fragments of the last layer, and what the next draws.
@group(3) @binding(2) var<storage, read> n_fragments: array<u32, 2>;
@group(3) @binding(3) var<storage, read_write> draws: array<u32, 12>;

// Pixels a side that a texel of the valid region stands for.
override VALID_PX: u32 = 1u;

struct ClosedVarying {
    // The same to the last bit for every layer.
    @invariant @builtin(position) position: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) @interpolate(flat) face: vec3<u32>,
}

// Depth that tells places apart as well near as far, and does not end where the scene does.
fn peel_position(place: vec3<f32>) -> vec4<f32> {
    let clip = view.clip_from_anchor * vec4<f32>(place, 1.0);
    let t = dot(place - view.eye_from_anchor, view.forward);
    let parallel = 0.5 - (t - hull_frame.middle_m) / PARALLEL_REACH_M;
    return vec4<f32>(clip.xy, select(VIEW_NEAR_M, parallel, view.is_parallel != 0u), clip.w);
}

// Two triangles: of a cone's side from its apex on, and of its end far away. Ends of an outline's edges together cover what it
// surrounds once, and everything else as often one way as the other. Seen from what the cone takes away, they turn clockwise.
@vertex
fn vs_closed(@builtin(vertex_index) corner: u32, in: HullFace) -> ClosedVarying {
    var place = vec3<f32>(0.0);
    if in.face.y == NO_VIEW {
        // The bounds are what is not taken away: turned the other way.
        let order = array<u32, 6>(0u, 2u, 1u, 1u, 2u, 3u);
        let reversed = array<u32, 6>(0u, 1u, 2u, 1u, 3u, 2u);
        place = face_corner(select(reversed[corner], order[corner], (in.face.z & 1u) != 0u), in.face);
    } else {
        let camera_idx = hull_views[in.face.y].camera_idx;
        let edge = hull_edges[in.face.z];
        let far = reach_of(in.face.x, in.face.y).y;
        var local = vec3<f32>(0.0);
        switch corner {
            case 1u, 5u: { local = vec3<f32>(edge.xy, 1.0) * far; }
            case 2u, 4u: { local = vec3<f32>(edge.zw, 1.0) * far; }
            case 3u: { local = vec3<f32>(0.0, 0.0, far); }
            default: {}
        }
        place = eye_of(in.face.y) + from_camera_axes(camera_idx, local);
    }
    return ClosedVarying(peel_position(place), place, in.face);
}

fn is_valid(pixel: vec2<u32>) -> bool {
    // Grown by a texel: what is thinner than one may have been missed in its own.
    let at = vec2<i32>(pixel / max(VALID_PX, 1u));
    let most = vec2<i32>(textureDimensions(valid)) - 1;
    for (var i = 0; i < 9; i++) {
        let beside = clamp(at + vec2<i32>(i % 3 - 1, i / 3 - 1), vec2<i32>(0), most);
        if textureLoad(valid, beside, 0).z != 0u {
            return true;
        }
    }
    return false;
}

fn is_seen_by_any(hull_idx: u32, place: vec3<f32>) -> bool {
    let first = hulls[hull_idx].first_view;
    for (var k = 0u; k < hulls[hull_idx].n_views; k++) {
        let seen = seen_by(first + k, place);
        if seen.is_seen && all(seen.texture >= vec2<f32>(0.0)) && all(seen.texture <= vec2<f32>(1.0)) {
            return true;
        }
    }
    return false;
}

// The nearest face behind the last layer through which a ray leaves what a cone takes away, or comes into the bounds.
@fragment
fn fs_layer(in: ClosedVarying) -> @location(0) vec4<u32> {
    let pixel = vec2<u32>(in.position.xy);
    let is_behind = in.position.z < textureLoad(layer_depth, pixel, 0);
    // Behind what is found already nothing is looked for.
    let is_wanted = is_behind && in.position.z > textureLoad(found_depth, pixel, 0);
    if !is_wanted || !is_within_hull_bounds(in.face.x, in.place) {
        discard;
    }
    if !is_seen_by_any(in.face.x, in.place) {
        discard;
    }
    let ray = hull_ray(in.position.xy);
    let t = dot(in.place - ray.origin, view.forward);
    let normal = face_normal(in.face);
    let towards = select(normal, -normal, dot(normal, ray.direction) > 0.0);
    return packed_surface(HullSurface(t, towards, in.face.x, 0.0, 1.0, edge_of(in.face)));
}

// One for a cone that ends behind the layer, one less for one that begins: what is left holds what is just behind it.
@fragment
fn fs_count(in: ClosedVarying, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    if in.position.z >= textureLoad(layer_depth, vec2<u32>(in.position.xy), 0) {
        discard;
    }
    return vec4<f32>(select(1.0, -1.0, is_front), 0.0, 0.0, 0.0);
}

@vertex
fn vs_full(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

// The layer before the first is before all where there may be a hull, and behind all elsewhere: no layer has anything there.
@fragment
fn fs_prime(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    if !is_valid(vec2<u32>(position.xy)) {
        discard;
    }
    return 1.0;
}

struct Resolved {
    @location(0) surface: vec4<u32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fs_resolve(@builtin(position) position: vec4<f32>) -> Resolved {
    let pixel = vec2<u32>(position.xy);
    let texel = textureLoad(layer, pixel, 0);
    if texel.z == 0u || abs(textureLoad(count, pixel, 0).r) > 0.5 {
        discard;
    }
    let t = bitcast<f32>(texel.x);
    let parallel = 0.5 - (t - hull_frame.middle_m) / PARALLEL_REACH_M;
    return Resolved(texel, clamp(select(VIEW_NEAR_M / t, parallel, view.is_parallel != 0u), 1e-30, 1.0));
}

// Nothing is drawn any more once a layer was empty.
@compute @workgroup_size(1)
fn cs_draws() {
    if n_fragments[0] == 0u && n_fragments[1] == 0u {
        draws[1] = 0u;
        draws[5] = 0u;
        draws[9] = 0u;
    }
}
