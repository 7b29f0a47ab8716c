// How much each camera lends to every vertex of a scene's fine mesh, for one who looks from somewhere, following smoothly.
//
// src/vision/fields/field.rs (Field::target) and history.rs (Weights::follow) are its counterparts and specification, of the at most eight
// cameras that lend to a vertex' group of triangles.
#import "common/lists.wgsl"

// Most cameras of a field: fields::MAX_VIEWS.
const MAX_VIEWS: u32 = 64u;
// In place of a camera where a group has fewer than eight.
const NO_VIEW: u32 = 0xffffffffu;
// Cosine between the directions to the viewer and to the nearest camera below which fields give way to normals.
const LEAST_ALIKE: f32 = 0.1;

struct FieldFrame {
    // Where the viewer is, from the mesh's origin, metres; of parallel rays the unit vector towards the viewer.
    viewer: vec3<f32>,
    is_parallel: u32,
    n_vertices: u32,
    // Most cameras that lend to a vertex, of the best first.
    most_cameras: u32,
    // How wrong depths are, metres.
    depth_m: f32,
    // Which share of the way to what they should be weights go now.
    follow: f32,
    // 0 where normals alone decide.
    is_montage: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
    // Where cameras are, from the mesh's origin, metres; w is 0 where one has no picture now.
    eyes: array<vec4<f32>, MAX_VIEWS>,
}

struct FieldVertex {
    // From the mesh's origin, metres.
    position: vec3<f32>,
    group: u32,
    // How far from the seams of each camera of the group, 0 to 1; 0 of who does not see it.
    ramps_low: vec4<f32>,
    ramps_high: vec4<f32>,
    // What each lends by normals alone.
    normals_low: vec4<f32>,
    normals_high: vec4<f32>,
    // How large a pixel of each is on the surface, metres.
    pixels_low: vec4<f32>,
    pixels_high: vec4<f32>,
    // What each lends where fields give way.
    fallback_low: vec4<f32>,
    fallback_high: vec4<f32>,
}

// The cameras of a group, the best first.
struct FieldGroup {
    low: vec4<u32>,
    high: vec4<u32>,
}

struct Lent {
    low: vec4<f32>,
    high: vec4<f32>,
}

@group(0) @binding(0) var<storage, read> frame: FieldFrame;
@group(0) @binding(1) var<storage, read> vertices: array<FieldVertex>;
@group(0) @binding(2) var<storage, read> groups: array<FieldGroup>;
@group(0) @binding(3) var<storage, read_write> weights: array<Lent>;

fn total(lent: Lent) -> f32 {
    return dot(lent.low, vec4<f32>(1.0)) + dot(lent.high, vec4<f32>(1.0));
}

// 1 of so many first cameras that show something now, else 0.
fn shown(views: vec4<u32>, first: u32, most: u32) -> vec4<f32> {
    var is_shown = vec4<f32>(0.0);
    for (var slot = 0u; slot < 4u; slot++) {
        let view = views[slot];
        if view < MAX_VIEWS && first + slot < most {
            is_shown[slot] = frame.eyes[view].w;
        }
    }
    return is_shown;
}

fn times(lent: Lent, factor: f32) -> Lent {
    return Lent(lent.low * factor, lent.high * factor);
}

@compute @workgroup_size(64)
fn cs_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let idx = index(id, n_groups);
    if idx >= frame.n_vertices {
        return;
    }
    let vertex = vertices[idx];
    let group = groups[vertex.group];
    let most = frame.most_cameras;
    let here = Lent(shown(group.low, 0u, most), shown(group.high, 4u, most));
    var row = Lent(vertex.normals_low * here.low, vertex.normals_high * here.high);
    if frame.is_montage != 0u {
        row = Lent(vertex.fallback_low * here.low, vertex.fallback_high * here.high);
    }
    if !(total(row) > 0.0) {
        // Who lends here is beyond those that are mixed: these go on as if they saw it. Where nobody lends, nobody does.
        let all = Lent(shown(group.low, 0u, 8u), shown(group.high, 4u, 8u));
        let lent = Lent(vertex.normals_low * all.low, vertex.normals_high * all.high);
        row = times(here, select(0.0, 1.0, total(lent) > 0.0));
    }
    row = times(row, 1.0 / max(total(row), 1e-30));
    if frame.is_montage != 0u {
        row = montage(vertex, group, here, row);
    }
    let before = weights[idx];
    // Where nobody lent anything, or does now, it is there at once.
    if frame.follow < 1.0 && total(before) > 0.0 && total(row) > 0.0 {
        row = Lent(mix(before.low, row.low, frame.follow), mix(before.high, row.high, frame.follow));
    }
    weights[idx] = row;
}

// The least error counts most: e of a wrong depth seen from another direction and of a large pixel, as its fourth power's reciprocal.
fn montage(vertex: FieldVertex, group: FieldGroup, here: Lent, fallback: Lent) -> Lent {
    let to_viewer = select(
        normalize_or_zero(frame.viewer - vertex.position), frame.viewer, frame.is_parallel != 0u);
    let ramps = Lent(vertex.ramps_low * here.low, vertex.ramps_high * here.high);
    var wanted = Lent(vec4<f32>(0.0), vec4<f32>(0.0));
    var alike = 0.0;
    for (var slot = 0u; slot < 8u; slot++) {
        let ramp = select(ramps.low[slot & 3u], ramps.high[slot & 3u], slot >= 4u);
        if !(ramp > 0.0) {
            continue;
        }
        let view = select(group.low[slot & 3u], group.high[slot & 3u], slot >= 4u);
        let to_camera = normalize_or_zero(frame.eyes[view].xyz - vertex.position);
        alike = max(alike, dot(to_viewer, to_camera));
        let pixel_m = select(vertex.pixels_low[slot & 3u], vertex.pixels_high[slot & 3u], slot >= 4u);
        // By the sine, without the cancellation where both look alike.
        let error_m = length(vec2<f32>(frame.depth_m * length(cross(to_viewer, to_camera)), pixel_m));
        let counts = 1.0 / max(error_m, 1e-12);
        if slot < 4u {
            wanted.low[slot] = counts;
        } else {
            wanted.high[slot - 4u] = counts;
        }
    }
    let four = max(wanted.low, wanted.high);
    let most = max(max(four.x, four.y), max(four.z, four.w));
    if !(most > 0.0) {
        return fallback;
    }
    // Relative to the greatest, so that powers of small numbers do not vanish together.
    let low = wanted.low / most;
    let high = wanted.high / most;
    wanted = Lent(ramps.low * low * low * low * low, ramps.high * high * high * high * high);
    let sum = total(wanted);
    if !(sum > 0.0) {
        return fallback;
    }
    let share = min(total(ramps), 1.0) * clamp(alike / LEAST_ALIKE, 0.0, 1.0);
    return Lent(
        mix(fallback.low, wanted.low / sum, share), mix(fallback.high, wanted.high / sum, share));
}

fn normalize_or_zero(offset: vec3<f32>) -> vec3<f32> {
    return offset / max(length(offset), 1e-12);
}
