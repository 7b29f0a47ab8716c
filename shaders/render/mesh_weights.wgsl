// What every camera lends to the vertices of a changing mesh for one who looks, on the way there from what it lent before; and which
// cameras a face is drawn with. src/vision/fields/{field,history}.rs are the specification.
#import "common/changing_mesh.wgsl"
#import "common/lists.wgsl"

// From the mesh's origin, metres.
@group(1) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// Three a face.
@group(1) @binding(2) var<storage, read> corners: array<u32>;
// By vertex and view.
@group(1) @binding(3) var<storage, read> sights: array<u32>;
// By vertex and view: how far from its seams, the logarithm of a pixel's size, what it falls back to, what it lends by normals.
@group(1) @binding(4) var<storage, read> values: array<vec4<f32>>;
// By vertex and view.
@group(1) @binding(5) var<storage, read> before: array<f32>;
@group(1) @binding(6) var<storage, read_write> weights: array<f32>;
// Two words a face: a byte each of the views that lend most to it, NOBODY where there are fewer.
@group(1) @binding(7) var<storage, read_write> slots: array<vec2<u32>>;

const NOBODY: u32 = 0xffu;
const N_SLOTS: u32 = 8u;
// Cosine between the directions to the viewer and to the nearest camera below which fields give way to normals.
const LEAST_ALIKE: f32 = 0.1;

fn normalize_or_zero(offset: vec3<f32>) -> vec3<f32> {
    return offset / max(length(offset), 1e-12);
}

// The reciprocal of how far a camera's colour may be beside (x), and how much it looks as the viewer does (y).
fn wanted(view_idx: u32, place: vec3<f32>, to_viewer: vec3<f32>, log_pixel_m: f32) -> vec2<f32> {
    let to_camera = normalize_or_zero(mesh.cameras[view_idx].eye - place);
    // By the sine, without the cancellation where both look alike.
    let beside_m = mesh.depth_m * length(cross(to_viewer, to_camera));
    let error_m = length(vec2<f32>(beside_m, exp(log_pixel_m)));
    return vec2<f32>(1.0 / max(error_m, 1e-12), dot(to_viewer, to_camera));
}

// A thread a vertex.
@compute @workgroup_size(64)
fn cs_weights(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let first = vertex * mesh.n_views;
    let place = positions[vertex].xyz;
    let to_viewer = select(normalize_or_zero(mesh.viewer - place), mesh.viewer, mesh.is_parallel != 0u);
    let is_montage = mesh.is_montage != 0u;
    var most = 0.0;
    var alike = 0.0;
    var n_lending = 0.0;
    var fallen_back = 0.0;
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let value = values[first + view_idx];
        fallen_back += select(value.w, value.z, is_montage);
        if is_montage && sights[first + view_idx] == SEEN && value.x > 0.0 {
            let found = wanted(view_idx, place, to_viewer, value.y);
            most = max(most, found.x);
            alike = max(alike, found.y);
            n_lending += value.x;
        }
    }
    var sum = 0.0;
    if most > 0.0 {
        for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
            let value = values[first + view_idx];
            if sights[first + view_idx] == SEEN && value.x > 0.0 {
                // Relative to the greatest, so that powers of small numbers do not vanish together.
                let near = wanted(view_idx, place, to_viewer, value.y).x / most;
                sum += value.x * near * near * near * near;
            }
        }
    }
    let share = select(0.0, min(n_lending, 1.0) * clamp(alike / LEAST_ALIKE, 0.0, 1.0), sum > 0.0);
    var total = 0.0;
    var kept = 0.0;
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let at = first + view_idx;
        let value = values[at];
        var lent = (1.0 - share) * select(value.w, value.z, is_montage) / max(fallen_back, 1e-30);
        let is_trusted = sights[at] == SEEN && value.x > 0.0;
        if share > 0.0 && is_trusted {
            let near = wanted(view_idx, place, to_viewer, value.y).x / most;
            lent += share * value.x * near * near * near * near / sum;
        }
        weights[at] = lent;
        total += lent;
        // Who no longer sees a place would lend another's colours.
        kept += select(before[at], 0.0, lent <= 0.0 && sights[at] != SEEN);
    }
    // Where nobody lent anything, or does now, it is there at once.
    let goes_on = mesh.follow < 1.0 && kept > 0.0 && total > 0.0;
    if !goes_on {
        return;
    }
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let at = first + view_idx;
        let lent = weights[at];
        let was = select(before[at] / kept, 0.0, lent <= 0.0 && sights[at] != SEEN);
        weights[at] = mix(was, lent, mesh.follow);
    }
}

// A thread a face: of more views than are drawn with, those that lend most to its corners.
@compute @workgroup_size(64)
fn cs_slots(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let face = index(id, n_groups);
    if face >= mesh.n_faces {
        return;
    }
    let of_face = vec3<u32>(corners[3u * face], corners[3u * face + 1u], corners[3u * face + 2u]) * mesh.n_views;
    var taken = vec2<u32>(0u);
    var chosen = vec2<u32>(0xffffffffu);
    for (var slot = 0u; slot < min(N_SLOTS, mesh.most_cameras); slot++) {
        var best = NOBODY;
        var most = 0.0;
        for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
            let is_taken = (taken[view_idx >> 5u] >> (view_idx & 31u)) & 1u;
            let lent = weights[of_face.x + view_idx] + weights[of_face.y + view_idx] + weights[of_face.z + view_idx];
            if is_taken == 0u && lent > most {
                most = lent;
                best = view_idx;
            }
        }
        if best == NOBODY {
            break;
        }
        taken[best >> 5u] |= 1u << (best & 31u);
        let low = (slot & 3u) * 8u;
        chosen[slot >> 2u] = (chosen[slot >> 2u] & ~(0xffu << low)) | (best << low);
    }
    slots[face] = chosen;
}
