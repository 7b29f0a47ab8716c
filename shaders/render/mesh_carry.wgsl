// What cameras lent to a mesh before it changed, at the nearest of its vertices: what the weights of another mesh follow on from.
// src/vision/fields/history.rs is the specification, by nearest places of the surface.
#import "common/changing_mesh.wgsl"
#import "common/lists.wgsl"

// Where vertices are by what they are of, metres: as of one who walks, if that is known.
@group(1) @binding(1) var<storage, read> homes: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read> homes_before: array<vec4<f32>>;
// By vertex and view of the mesh before.
@group(1) @binding(3) var<storage, read> weights_before: array<f32>;
// 0 where nobody is, else one more than the first vertex of a cell; and of every vertex the same of the next.
@group(1) @binding(4) var<storage, read_write> heads: array<atomic<u32>>;
@group(1) @binding(5) var<storage, read_write> following: array<u32>;
// By vertex and view.
@group(1) @binding(6) var<storage, read_write> carried: array<f32>;

// Vertices that are mixed; and those that are looked at in one cell, at most.
const N_NEAREST: u32 = 4u;
const MOST_LOOKED_AT: u32 = 128u;

fn cell_of(home: vec3<f32>) -> vec3<i32> {
    return vec3<i32>(floor(home / mesh.cell_m));
}

fn slot_of(cell: vec3<i32>) -> u32 {
    let at = bitcast<vec3<u32>>(cell);
    var hash = at.x * 0x9e3779b1u ^ at.y * 0x85ebca77u ^ at.z * 0xc2b2ae3du;
    hash = (hash ^ (hash >> 15u)) * 0x2c1b3c6du;
    return (hash ^ (hash >> 13u)) & mesh.table_mask;
}

// A thread a vertex of the mesh before.
@compute @workgroup_size(64)
fn cs_enter(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_before {
        return;
    }
    following[vertex] = atomicExchange(&heads[slot_of(cell_of(homes_before[vertex].xyz))], vertex + 1u);
}

// A thread a vertex.
@compute @workgroup_size(64)
fn cs_carry(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let vertex = index(id, n_groups);
    if vertex >= mesh.n_vertices {
        return;
    }
    let home = homes[vertex].xyz;
    let middle = cell_of(home);
    // The nearest first.
    var nearest = vec4<u32>(0u);
    var apart = vec4<f32>(mesh.cell_m);
    for (var over = 0; over < 27; over++) {
        let cell = middle + vec3<i32>(over % 3 - 1, over / 3 % 3 - 1, over / 9 - 1);
        var met = atomicLoad(&heads[slot_of(cell)]);
        for (var step = 0u; step < MOST_LOOKED_AT && met != 0u; step++) {
            let other = homes_before[met - 1u].xyz;
            // Cells that share a slot are each looked at for themselves.
            if all(cell_of(other) == cell) {
                var one = met;
                var off = distance(other, home);
                for (var place = 0u; place < N_NEAREST; place++) {
                    // Of equally near ones the lesser comes first, whoever was entered first.
                    let is_nearer = off < apart[place] || (off == apart[place] && one < nearest[place]);
                    if is_nearer {
                        let further = nearest[place];
                        let further_off = apart[place];
                        nearest[place] = one;
                        apart[place] = off;
                        one = further;
                        off = further_off;
                    }
                }
            }
            met = following[met - 1u];
        }
    }
    // Each counts the less the farther it is, and nothing where it ceases to be looked for.
    var shares = vec4<f32>(0.0);
    for (var place = 0u; place < N_NEAREST; place++) {
        if nearest[place] != 0u {
            let share = apart[place] / mesh.cell_m;
            shares[place] = (1.0 - share) * (1.0 - share) / max(share * share, 1e-6);
        }
    }
    let first = vertex * mesh.n_views;
    var total = 0.0;
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        let was = mesh.cameras[view_idx].was;
        var sum = 0.0;
        for (var place = 0u; place < N_NEAREST; place++) {
            if was != 0u && shares[place] > 0.0 {
                sum += shares[place] * weights_before[(nearest[place] - 1u) * mesh.n_views_before + was - 1u];
            }
        }
        carried[first + view_idx] = sum;
        total += sum;
    }
    let scale = select(0.0, 1.0 / max(total, 1e-30), total > 0.0);
    for (var view_idx = 0u; view_idx < mesh.n_views; view_idx++) {
        carried[first + view_idx] *= scale;
    }
}
