// What the vertices of a changing mesh look like from everywhere: what is shown where no camera lends anything, filled from beside
// where none sees it. src/vision/fields/field.rs and src/vision/mesh/fill.rs are the specification.
#import "common/camera.wgsl"
#import "common/changing_mesh.wgsl"
#import "common/lists.wgsl"

// w: the part that the vertex is of, by number. From the mesh's origin, metres.
@group(1) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// By part and view: what a camera of a part has moved by (xyz).
@group(1) @binding(2) var<storage, read> shifts: array<vec4<f32>>;
// By vertex and view; w: what it lends by normals.
@group(1) @binding(3) var<storage, read> values: array<vec4<f32>>;
// NEIGHBOURS a vertex: how many there are, and the first of them.
@group(1) @binding(4) var<storage, read> neighbours: array<u32>;
// By vertex: linear light, and 1 where it is known; to begin with, the mesh's own.
@group(1) @binding(5) var<storage, read> before: array<vec4<f32>>;
@group(1) @binding(6) var<storage, read_write> after: array<vec4<f32>>;
@group(1) @binding(7) var frames: texture_2d_array<f32>;
@group(1) @binding(8) var frame_sampler: sampler;

const NEIGHBOURS: u32 = 16u;

// A thread a vertex.
@compute @workgroup_size(64)
fn cs_colors(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let place = positions[vertex];
    var sum = vec4<f32>(0.0);
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let lent = values[vertex * mesh.n_views + view_idx].w;
        if !(lent > 0.0) {
            continue;
        }
        let camera_idx = mesh.cameras[view_idx].camera_idx;
        let moved = shifts[u32(place.w) * mesh.n_views + view_idx].xyz;
        let seen = project(camera_idx, place.xyz + mesh.shift - moved);
        let at = clamp(seen.texture, vec2<f32>(0.0), vec2<f32>(1.0)) * cameras[camera_idx].frame_scale;
        let color = textureSampleLevel(frames, frame_sampler, at, cameras[camera_idx].frame_layer, 0.0);
        sum += lent * vec4<f32>(evened(camera_idx, color.rgb), 1.0);
    }
    // What no camera sees has the mesh's own colour, where it has any.
    after[vertex] = select(before[vertex], vec4<f32>(sum.rgb / max(sum.a, 1e-30), 1.0), sum.a > 0.0);
}

// A thread a vertex: what is not known becomes the mean of what is beside it.
@compute @workgroup_size(64)
fn cs_fill(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let own = before[vertex];
    var sum = vec4<f32>(0.0);
    if own.w <= 0.0 {
        for (var i = 1u; i <= min(neighbours[vertex * NEIGHBOURS], NEIGHBOURS - 1u); i++) {
            let other = before[neighbours[vertex * NEIGHBOURS + i]];
            sum += select(vec4<f32>(0.0), vec4<f32>(other.rgb, 1.0), other.w > 0.0);
        }
    }
    let is_filled = own.w <= 0.0 && sum.w > 0.0;
    after[vertex] = select(own, vec4<f32>(sum.rgb / max(sum.w, 1.0), 1.0), is_filled);
}
