// Which faces of a mesh meet at which sides, and at which vertices shortest ways may bend: src/vision/fields/topology.rs is its counterpart.
//
// A half-edge is a side of a face: three times the face and the corner across. Those of the same two vertices find each other in a
// table, each of whose slots keeps the first that came; of more than two some stay alone.
#import "common/lists.wgsl"

struct MeshSize {
    n_vertices: u32,
    n_faces: u32,
    // The table has one more slots, a power of two.
    table_mask: u32,
    // Sources apart by less are one, metres: of fields_distances.wgsl.
    same_m: f32,
}

@group(0) @binding(0) var<storage, read> mesh: MeshSize;
// From the mesh's origin, metres.
@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
// Three a face.
@group(0) @binding(2) var<storage, read> corners: array<u32>;
// 0 where nobody is, else one more than a half-edge.
@group(0) @binding(3) var<storage, read_write> table: array<atomic<u32>>;
// By half-edge: 0 without a face on the other side, else one more than the half-edge there.
@group(0) @binding(4) var<storage, read_write> opposite: array<u32>;
// By vertex: what the angles of its faces add up to, in parts of a full turn.
@group(0) @binding(5) var<storage, read_write> turns: array<atomic<u32>>;

// Parts of a full turn.
const FULL_TURN: f32 = 16777216.0;
const TAU: f32 = 6.283185307179586;
// More than any turn: of vertices at borders.
const AT_BORDER: u32 = 0x40000000u;

fn position(vertex: u32) -> vec3<f32> {
    return positions[vertex].xyz;
}

fn is_face(face: u32) -> bool {
    let a = position(corners[3u * face]);
    let b = position(corners[3u * face + 1u]);
    let c = position(corners[3u * face + 2u]);
    return has_area(a, b, c);
}

// The ends of a half-edge, the lesser first.
fn ends(half_edge: u32) -> vec2<u32> {
    let face = half_edge / 3u;
    let corner = half_edge % 3u;
    let one = corners[3u * face + (corner + 1u) % 3u];
    let other = corners[3u * face + (corner + 2u) % 3u];
    return vec2<u32>(min(one, other), max(one, other));
}

fn slot_of(side: vec2<u32>) -> u32 {
    var hash = side.x * 0x9e3779b1u ^ (side.y * 0x85ebca77u + 0xc2b2ae3du);
    hash = (hash ^ (hash >> 15u)) * 0x2c1b3c6du;
    hash = (hash ^ (hash >> 12u)) * 0x297a2d39u;
    return (hash ^ (hash >> 15u)) & mesh.table_mask;
}

// Every half-edge meets the one on the other side, and tells its corner's angle.
@compute @workgroup_size(64)
fn cs_meet(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let half_edge = index(id, n_groups);
    let face = half_edge / 3u;
    if face >= mesh.n_faces || !is_face(face) {
        return;
    }
    let corner = half_edge % 3u;
    let own = corners[half_edge];
    let at = position(own);
    let one = position(corners[3u * face + (corner + 1u) % 3u]) - at;
    let other = position(corners[3u * face + (corner + 2u) % 3u]) - at;
    let angle = atan2(length(cross(one, other)), dot(one, other));
    atomicAdd(&turns[own], u32(round(angle / TAU * FULL_TURN)));

    let side = ends(half_edge);
    var slot = slot_of(side);
    // The table has room for all of them: it is never full.
    for (var step = 0u; step <= mesh.table_mask; step++) {
        let met = atomicCompareExchangeWeak(&table[slot], 0u, half_edge + 1u);
        if met.exchanged {
            return;
        }
        // Weak exchanges may fail without cause: then the slot is looked at again.
        if met.old_value == 0u {
            continue;
        }
        let first = met.old_value - 1u;
        if all(ends(first) == side) {
            opposite[half_edge] = first + 1u;
            opposite[first] = half_edge + 1u;
            return;
        }
        slot = (slot + 1u) & mesh.table_mask;
    }
}

// Where nobody is on the other side, or not for each other, is a border.
@compute @workgroup_size(64)
fn cs_border(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let half_edge = index(id, n_groups);
    let face = half_edge / 3u;
    if face >= mesh.n_faces || !is_face(face) {
        return;
    }
    let other = opposite[half_edge];
    if other == 0u || opposite[other - 1u] != half_edge + 1u {
        let side = ends(half_edge);
        atomicOr(&turns[side.x], AT_BORDER);
        atomicOr(&turns[side.y], AT_BORDER);
    }
}
