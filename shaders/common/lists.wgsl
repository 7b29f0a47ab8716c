// What passes over a mesh's lists have in common: one thread an entry, and which triangles are faces.

// Threads of a group: GROUP of src/render/passes/compute.rs.
const GROUP: u32 = 64u;

// Which entry a thread is: more than one row of groups may have lie in several.
fn index(id: vec3<u32>, n_groups: vec3<u32>) -> u32 {
    return id.x + id.y * n_groups.x * GROUP;
}

// Triangles whose area is below this share of their longest side squared have none, in single precision.
const LEAST_AREA: f32 = 1e-7;

fn has_area(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    let longest = max(max(dot(b - a, b - a), dot(c - a, c - a)), dot(c - b, c - b));
    return length(cross(b - a, c - a)) > LEAST_AREA * longest;
}
