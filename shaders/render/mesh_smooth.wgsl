// What weights of a changing mesh are made of, without steps from vertex to vertex.
// src/vision/fields/{field,smoothing}.rs are the specification.
#import "common/changing_mesh.wgsl"
#import "common/lists.wgsl"

// From the mesh's origin, metres.
@group(1) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// Three a face.
@group(1) @binding(2) var<storage, read> corners: array<u32>;
// By half-edge: 0 without a face on the other side, else one more than the half-edge there (fields_topology.wgsl).
@group(1) @binding(3) var<storage, read> opposite: array<u32>;
// NEIGHBOURS a vertex: how many there are, and the first of them.
@group(1) @binding(4) var<storage, read_write> neighbours: array<atomic<u32>>;
// By vertex and view.
@group(1) @binding(5) var<storage, read> sights: array<u32>;
// By view and vertex, metres.
@group(1) @binding(6) var<storage, read> distances: array<f32>;
// By vertex and view: how far from its seams, 0 to 1 (x); the logarithm of a pixel's longer side, metres (y); what it lends where
// fields give way, of a sum that is none yet (z); what it lends by normals (w), before cs_lent the cosine at which it sees.
@group(1) @binding(7) var<storage, read> before: array<vec4<f32>>;
@group(1) @binding(8) var<storage, read_write> after: array<vec4<f32>>;

// Words of a vertex's list: NEIGHBOUR_WORDS of passes/changing_mesh.rs.
const NEIGHBOURS: u32 = 16u;

fn is_face(face: u32) -> bool {
    let a = positions[corners[3u * face]].xyz;
    let b = positions[corners[3u * face + 1u]].xyz;
    let c = positions[corners[3u * face + 2u]].xyz;
    return has_area(a, b, c);
}

fn enter(vertex: u32, neighbour: u32) {
    let place = atomicAdd(&neighbours[vertex * NEIGHBOURS], 1u) + 1u;
    if place < NEIGHBOURS {
        atomicStore(&neighbours[vertex * NEIGHBOURS + place], neighbour);
    }
}

// A thread a half-edge: both ends of a side are neighbours, told by one of its half-edges.
@compute @workgroup_size(64)
fn cs_neighbours(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let half_edge = index(id, n_groups);
    let face = half_edge / 3u;
    if face >= mesh.n_faces || !is_face(face) {
        return;
    }
    let other = opposite[half_edge];
    if other != 0u && other - 1u < half_edge {
        return;
    }
    let corner = half_edge % 3u;
    let one = corners[3u * face + (corner + 1u) % 3u];
    let another = corners[3u * face + (corner + 2u) % 3u];
    enter(one, another);
    enter(another, one);
}

fn n_neighbours(vertex: u32) -> u32 {
    return min(atomicLoad(&neighbours[vertex * NEIGHBOURS]), NEIGHBOURS - 1u);
}

// A thread a vertex: in growing order, so that sums are the same whoever came first.
@compute @workgroup_size(64)
fn cs_order(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let n = n_neighbours(vertex);
    let first = vertex * NEIGHBOURS + 1u;
    for (var i = 1u; i < n; i++) {
        let moved = atomicLoad(&neighbours[first + i]);
        var to = i;
        for (; to > 0u; to--) {
            let other = atomicLoad(&neighbours[first + to - 1u]);
            if other <= moved {
                break;
            }
            atomicStore(&neighbours[first + to], other);
        }
        atomicStore(&neighbours[first + to], moved);
    }
}

// A thread a vertex: ramps, and weights by normals of whoever is believed most of those that see it.
@compute @workgroup_size(64)
fn cs_lent(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let first = vertex * mesh.n_views;
    // How squarely the best of each kind looks.
    var most = vec3<f32>(0.0);
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let sight = sights[first + view_idx];
        if sight <= NEAR {
            most[sight] = max(most[sight], before[first + view_idx].w);
        }
    }
    var believed = NEAR;
    if most.x > 0.0 {
        believed = SEEN;
    } else if most.y > 0.0 {
        believed = OUTVOTED;
    }
    let squarest = max(most[believed], 1e-12);
    var sum = 0.0;
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        if sights[first + view_idx] == believed {
            sum += pow(before[first + view_idx].w / squarest, mesh.normal_exponent);
        }
    }
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let at = first + view_idx;
        let sight = sights[at];
        var share = 0.0;
        if sight == believed && sum > 0.0 {
            share = pow(before[at].w / squarest, mesh.normal_exponent) / sum;
        }
        var ramp = 0.0;
        if sight == SEEN {
            let distance_m = distances[view_idx * mesh.n_vertices + vertex];
            ramp = select(1.0, min(distance_m / mesh.reach_m, 1.0), mesh.has_ramps != 0u);
        }
        after[at] = vec4<f32>(ramp, before[at].y, share, share);
    }
}

// A thread a vertex and view: halfway to the mean of the neighbours.
@compute @workgroup_size(64)
fn cs_smooth(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let at = index(id, n_groups);
    let vertex = at / mesh.n_views;
    if vertex >= mesh.n_vertices {
        return;
    }
    let view_idx = at % mesh.n_views;
    let n = n_neighbours(vertex);
    var own = before[at];
    let is_seen = sights[at] == SEEN;
    if n == 0u || !(is_seen || own.w > 0.0) {
        after[at] = own;
        return;
    }
    var sum = vec3<f32>(0.0);
    var n_seeing = 0.0;
    for (var i = 1u; i <= n; i++) {
        let other = atomicLoad(&neighbours[vertex * NEIGHBOURS + i]) * mesh.n_views + view_idx;
        let value = before[other];
        let sees = select(0.0, 1.0, sights[other] == SEEN);
        sum += vec3<f32>(value.x, sees * value.y, value.z);
        n_seeing += sees;
    }
    if is_seen {
        own.x = 0.5 * (own.x + sum.x / f32(n));
        if n_seeing > 0.0 {
            own.y = 0.5 * (own.y + sum.y / n_seeing);
        }
    }
    if own.w > 0.0 {
        own.z = 0.5 * (own.z + sum.z / f32(n));
    }
    after[at] = own;
}
