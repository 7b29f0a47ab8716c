// A changing mesh, coloured by what cameras lend to its vertices.
#import "common/view.wgsl"
#import "common/camera.wgsl"

@group(2) @binding(0) var frames: texture_2d_array<f32>;
@group(2) @binding(1) var frame_sampler: sampler;

#import "common/changing_mesh.wgsl"

// w: the part that the vertex is of, by number. From the mesh's origin, metres.
@group(1) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// Three a face.
@group(1) @binding(2) var<storage, read> corners: array<u32>;
// By part and view: what a camera of a part has moved by (xyz).
@group(1) @binding(3) var<storage, read> shifts: array<vec4<f32>>;
// By vertex and view.
@group(1) @binding(4) var<storage, read> weights: array<f32>;
// Two words a face: a byte each of the views that lend most to it, NOBODY where there are fewer.
@group(1) @binding(5) var<storage, read> slots: array<vec2<u32>>;
// By vertex: linear light, and 1 where it is known.
@group(1) @binding(6) var<storage, read> colors: array<vec4<f32>>;

const NOBODY: u32 = 0xffu;
// Cameras that are mixed at a place.
override N_LISTED: u32 = 8u;
// Below this a camera lends nothing.
const LEAST_WEIGHT: f32 = 1e-6;
// What nobody sees, and nothing beside it: UNSEEN of src/vision/mesh/fill.rs.
const UNSEEN: vec3<f32> = vec3<f32>(0.2, 0.2, 0.2);

struct MeshVarying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) from_anchor: vec3<f32>,
    @location(1) @interpolate(perspective, centroid) lent_low: vec4<f32>,
    @location(2) @interpolate(perspective, centroid) lent_high: vec4<f32>,
    @location(3) @interpolate(perspective, centroid) color: vec4<f32>,
    @location(4) @interpolate(flat) slots: vec2<u32>,
    @location(5) @interpolate(flat) part: u32,
    // What all cameras lend together, whether they are mixed or not: 1, or 0 where nobody lends anything.
    @location(6) @interpolate(perspective, centroid) total: f32,
}

fn view_of(of_face: vec2<u32>, slot: u32) -> u32 {
    return (of_face[slot >> 2u] >> ((slot & 3u) * 8u)) & 0xffu;
}

@vertex
fn vs_main(@builtin(vertex_index) half_edge: u32) -> MeshVarying {
    let vertex = corners[half_edge];
    let place = positions[vertex];
    let of_face = slots[half_edge / 3u];
    var low = vec4<f32>(0.0);
    var high = vec4<f32>(0.0);
    for (var slot = 0u; slot < N_LISTED; slot++) {
        let view_idx = view_of(of_face, slot);
        if view_idx == NOBODY {
            break;
        }
        let lent = weights[vertex * mesh.n_views + view_idx];
        if slot < 4u {
            low[slot] = lent;
        } else {
            high[slot - 4u] = lent;
        }
    }
    var total = 0.0;
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        total += weights[vertex * mesh.n_views + view_idx];
    }
    let from_anchor = place.xyz + mesh.shift;
    let position = view.clip_from_anchor * vec4<f32>(from_anchor, 1.0);
    return MeshVarying(position, from_anchor, low, high, colors[vertex], of_face, u32(place.w), total);
}

@fragment
fn fs_main(in: MeshVarying) -> @location(0) vec4<f32> {
    var sum = vec4<f32>(0.0);
    for (var slot = 0u; slot < N_LISTED; slot++) {
        let view_idx = view_of(in.slots, slot);
        if view_idx == NOBODY {
            break;
        }
        let lent = select(in.lent_low[slot & 3u], in.lent_high[slot & 3u], slot >= 4u);
        let camera_idx = mesh.cameras[view_idx].camera_idx;
        let seen = project(camera_idx, in.from_anchor - shifts[in.part * mesh.n_views + view_idx].xyz);
        let is_inside = all(seen.texture >= vec2<f32>(0.0)) && all(seen.texture <= vec2<f32>(1.0));
        if !(lent > LEAST_WEIGHT && seen.is_seen && is_inside) {
            continue;
        }
        let at = seen.texture * cameras[camera_idx].frame_scale;
        let color = textureSampleLevel(frames, frame_sampler, at, cameras[camera_idx].frame_layer, 0.0);
        // What shows what lies behind is not of its colour.
        sum += vec4<f32>(evened(camera_idx, color.rgb), 1.0) * (lent * smoothstep(0.25, 0.75, color.a));
    }
    let beside = select(UNSEEN, in.color.rgb / max(in.color.w, 1e-6), in.color.w > 0.0);
    // Towards vertices that nobody sees more and more of their own colour.
    let seen = mix(beside, sum.rgb / max(sum.a, 1e-30), clamp(in.total, 0.0, 1.0));
    return vec4<f32>(select(beside, seen, sum.a > LEAST_WEIGHT), 1.0);
}
