// Who sees the vertices of a changing mesh, where that ends, and how far along the surface other vertices are from there.
// src/vision/fields/{sight,seams,marching}.rs are the specification.
#import "common/camera.wgsl"
#import "common/changing_mesh.wgsl"
#import "common/lists.wgsl"

// w: the part that the vertex is of, by number. From the mesh's origin, metres.
@group(1) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// Three a vertex.
@group(1) @binding(2) var<storage, read> normals: array<f32>;
// Three a face.
@group(1) @binding(3) var<storage, read> corners: array<u32>;
// By part and view: what a camera of a part has moved by (xyz), and whether it is one (w).
@group(1) @binding(4) var<storage, read> shifts: array<vec4<f32>>;
// By vertex and view.
@group(1) @binding(5) var<storage, read_write> sights: array<u32>;
// By vertex and view: of who sees a vertex the logarithm of a pixel's longer side there, metres (y), and the cosine at which it does (w).
@group(1) @binding(6) var<storage, read_write> values: array<vec4<f32>>;
// By view and vertex, bits of metres, which are ordered as what they mean.
@group(1) @binding(7) var<storage, read_write> distances: array<atomic<u32>>;
@group(1) @binding(8) var depth_maps: texture_depth_2d_array;
@group(1) @binding(9) var frames: texture_2d_array<f32>;

// Sine of half a degree: what is seen at less is smeared beyond use.
const LEAST_COSINE: f32 = 0.0087265;
// How much nearer, relative, what hides must be; and how much nearer begins another surface.
const DEPTH_BIAS: f32 = 1e-3;
const DISCONTINUITY: f32 = 0.02;
// By no more than this the plane at a vertex is believed to change the depth over four texels.
const MOST_SLOPE: f32 = 1.25;
// So near the border of what is of the mesh, pixels, colours are mixed with what lies behind.
const BORDER_PX: f32 = 1.5;
// Alpha from which on a pixel is of the mesh.
const LEAST_ALPHA: f32 = 0.5;
const INFINITE: u32 = 0x7f800000u;

fn is_foreground_at(camera_idx: u32, at_px: vec2<f32>) -> bool {
    let last = max(cameras[camera_idx].frame_size_px - 1.0, vec2<f32>(0.0));
    let texel = vec2<u32>(clamp(at_px, vec2<f32>(0.0), last));
    return textureLoad(frames, texel, cameras[camera_idx].frame_layer, 0).a >= LEAST_ALPHA;
}

fn is_foreground(camera_idx: u32, texture: vec2<f32>) -> bool {
    let at_px = texture * cameras[camera_idx].frame_size_px;
    var is_all = is_foreground_at(camera_idx, at_px);
    for (var i = 0u; i < 8u && is_all; i++) {
        let angle = f32(i) * TAU / 8.0;
        is_all = is_foreground_at(camera_idx, at_px + BORDER_PX * vec2<f32>(cos(angle), sin(angle)));
    }
    return is_all;
}

// Whether the surface that a camera sees first, so many texels beside a vertex, is nearer than the plane of the vertex there.
fn is_hidden(view_idx: u32, at_px: vec2<f32>, over: vec2<f32>, near: f32, slope: vec2<f32>, bias: f32) -> bool {
    let size = mesh.cameras[view_idx].map_px;
    let texel = clamp(floor(at_px + over), vec2<f32>(0.0), size - 1.0);
    let plane = near + dot(texel + 0.5 - at_px, slope);
    let limit = clamp(plane, near / MOST_SLOPE, near * MOST_SLOPE);
    return textureLoad(depth_maps, vec2<u32>(texel), view_idx, 0) > limit * (1.0 + bias);
}

fn sight_by_depth(view_idx: u32, seen: Projection, normal: vec3<f32>) -> u32 {
    let camera_idx = mesh.cameras[view_idx].camera_idx;
    let in_camera = vec3<f32>(
        dot(cameras[camera_idx].row_x.xyz, normal),
        dot(cameras[camera_idx].row_y.xyz, normal),
        dot(cameras[camera_idx].row_z.xyz, normal),
    );
    let size = mesh.cameras[view_idx].map_px;
    let at_px = seen.texture * size;
    // On the plane normal . p = h the inverse of depth is normal . (x, y, 1) / h at the tangents x and y.
    let height = dot(in_camera, seen.local);
    let near = CAMERA_NEAR_M / seen.local.z;
    let slope = CAMERA_NEAR_M * in_camera.xy / (cameras[camera_idx].focal * size)
        / select(height, -1e-12, height > -1e-12);
    // What is nearer and ends between the texels around a vertex hides nothing, as at the foot of a wall.
    var is_open = false;
    for (var i = 0u; i < 4u; i++) {
        let over = vec2<f32>(vec2<u32>(i & 1u, i >> 1u)) - 0.5;
        is_open = is_open || !is_hidden(view_idx, at_px, over, near, slope, DEPTH_BIAS);
    }
    if !is_open {
        return HIDDEN;
    }
    if mesh.visibility < BY_DILATED_DEPTHS {
        return SEEN;
    }
    // Three rings of eight directions: radii of 1.5, 3 and 4 texels, rounded.
    for (var ring = 0; ring < 3; ring++) {
        let straight = f32(2 + ring);
        let oblique = f32(1 + ring);
        for (var i = 0u; i < 8u; i++) {
            let angle = f32(i) * TAU / 8.0;
            let towards = round(vec2<f32>(cos(angle), sin(angle)));
            let is_straight = towards.x * towards.y == 0.0;
            let over = towards * select(oblique, straight, is_straight);
            if is_hidden(view_idx, at_px, over, near, slope, DISCONTINUITY) {
                return NEAR;
            }
        }
    }
    return SEEN;
}

// A thread a vertex and view.
@compute @workgroup_size(64)
fn cs_sight(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let at = index(id, n_groups);
    let vertex = at / mesh.n_views;
    if vertex >= mesh.n_vertices {
        return;
    }
    let view_idx = at % mesh.n_views;
    let place = positions[vertex];
    let normal = vec3<f32>(normals[3u * vertex], normals[3u * vertex + 1u], normals[3u * vertex + 2u]);
    let camera_idx = mesh.cameras[view_idx].camera_idx;
    let moved = shifts[u32(place.w) * mesh.n_views + view_idx];
    let seen = project(camera_idx, place.xyz + mesh.shift - moved.xyz);
    let is_inside = all(seen.texture >= vec2<f32>(0.0)) && all(seen.texture <= vec2<f32>(1.0));
    var sight = BESIDE;
    var value = vec4<f32>(0.0);
    let may_see = moved.w > 0.0 && mesh.cameras[view_idx].is_shown != 0u;
    if may_see && seen.is_seen && is_inside && seen.local.z > CAMERA_NEAR_M && is_foreground(camera_idx, seen.texture) {
        let to_eye = mesh.cameras[view_idx].eye - place.xyz + moved.xyz;
        let facing = dot(to_eye, normal) / max(length(to_eye), 1e-12);
        sight = HIDDEN;
        if facing > LEAST_COSINE {
            sight = SEEN;
            if mesh.visibility > BY_FACING {
                sight = sight_by_depth(view_idx, seen, normal);
            }
            let px_per_m = cameras[camera_idx].focal.x * cameras[camera_idx].frame_size_px.x / seen.local.z;
            value = vec4<f32>(0.0, -log(max(px_per_m * facing, 1e-12)), 0.0, facing);
        }
    }
    sights[at] = sight;
    values[at] = value;
    atomicStore(&distances[view_idx * mesh.n_vertices + vertex], INFINITE);
}

// A thread a face and view: triangles of which one or two corners are seen are seams.
@compute @workgroup_size(64)
fn cs_seams(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let at = index(id, n_groups);
    let face = at / mesh.n_views;
    if face >= mesh.n_faces {
        return;
    }
    let view_idx = at % mesh.n_views;
    let of_face = vec3<u32>(corners[3u * face], corners[3u * face + 1u], corners[3u * face + 2u]);
    var n_seen = 0u;
    for (var corner = 0u; corner < 3u; corner++) {
        n_seen += select(0u, 1u, sights[of_face[corner] * mesh.n_views + view_idx] == SEEN);
    }
    let is_seam = n_seen == 1u || n_seen == 2u;
    if !is_seam || !has_area(positions[of_face.x].xyz, positions[of_face.y].xyz, positions[of_face.z].xyz) {
        return;
    }
    for (var corner = 0u; corner < 3u; corner++) {
        atomicStore(&distances[view_idx * mesh.n_vertices + of_face[corner]], 0u);
    }
}

// How far the third corner is of a point in the plane that is so far from the other two and on their other side; along
// their sides where the straight way does not pass between them.
fn reached(a: vec3<f32>, b: vec3<f32>, own: vec3<f32>, from_a: f32, from_b: f32) -> f32 {
    let around = min(from_a + distance(a, own), from_b + distance(b, own));
    let length_m = distance(a, b);
    // What is infinite makes numbers that are none: nothing comes of them.
    if !(max(from_a, from_b) < 1e30) || length_m <= 0.0 {
        return around;
    }
    let along = (b - a) / length_m;
    let way = own - a;
    let apex = vec2<f32>(dot(way, along), length(cross(way, along)));
    let x = (from_a * from_a - from_b * from_b + length_m * length_m) / (2.0 * length_m);
    let source = vec2<f32>(x, -sqrt(max(from_a * from_a - x * x, 0.0)));
    let height = apex.y - source.y;
    let crossing = source.x - (apex.x - source.x) * source.y / max(height, 1e-30);
    let passes = height > 0.0 && crossing >= 0.0 && crossing <= length_m;
    return select(around, min(around, distance(source, apex)), passes);
}

// A thread a face and view: one round in which each corner is reached from the other two.
@compute @workgroup_size(64)
fn cs_march(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let at = index(id, n_groups);
    let face = at / mesh.n_views;
    if face >= mesh.n_faces {
        return;
    }
    let first = at % mesh.n_views * mesh.n_vertices;
    let of_face = vec3<u32>(corners[3u * face], corners[3u * face + 1u], corners[3u * face + 2u]);
    var known: vec3<f32>;
    for (var corner = 0u; corner < 3u; corner++) {
        known[corner] = bitcast<f32>(atomicLoad(&distances[first + of_face[corner]]));
    }
    // Of what lies beyond the reach nobody asks how far it is.
    if !(min(known.x, min(known.y, known.z)) < mesh.reach_m) || max(known.x, max(known.y, known.z)) <= 0.0 {
        return;
    }
    let a = positions[of_face.x].xyz;
    let b = positions[of_face.y].xyz;
    let c = positions[of_face.z].xyz;
    if !has_area(a, b, c) {
        return;
    }
    let found = vec3<f32>(
        reached(b, c, a, known.y, known.z), reached(c, a, b, known.z, known.x), reached(a, b, c, known.x, known.y));
    for (var corner = 0u; corner < 3u; corner++) {
        if found[corner] < known[corner] {
            atomicMin(&distances[first + of_face[corner]], bitcast<u32>(found[corner]));
        }
    }
}
