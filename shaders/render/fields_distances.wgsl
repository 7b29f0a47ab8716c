// Distances along a mesh from the nearest of many vertices, in rounds that every half-edge does on its own, of two windows each:
// src/vision/fields/bounded.rs is its counterpart and specification, with the names and steps of this file.
//
// A window carries the source that it sees, in the plane of the face that is looked into, and not distances to it.
#import "common/lists.wgsl"

struct MeshSize {
    n_vertices: u32,
    n_faces: u32,
    table_mask: u32,
    // Sources apart by less are one, metres.
    same_m: f32,
}

// Two windows of a half-edge, that look into its face through the side across its corner.
struct Kept {
    // From where to where along the side from its lesser end, and the source along it and before it, metres.
    first: vec4<f32>,
    second: vec4<f32>,
    // How far both sources are, each followed by whether there is the window.
    beyond: vec4<f32>,
}

@group(0) @binding(0) var<storage, read> mesh: MeshSize;
@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> corners: array<u32>;
@group(0) @binding(3) var<storage, read> opposite: array<u32>;
@group(0) @binding(4) var<storage, read> turns: array<u32>;
@group(0) @binding(5) var<storage, read> kept_before: array<Kept>;
@group(0) @binding(6) var<storage, read_write> kept_after: array<Kept>;
// By vertex, as bits of what is at least 0: these are ordered as what they mean.
@group(0) @binding(7) var<storage, read> distances_before: array<u32>;
@group(0) @binding(8) var<storage, read_write> distances_after: array<atomic<u32>>;

const FULL_TURN: u32 = 16777216u;
// What rounding of angles may add to a full turn.
const TURN_SLACK: u32 = 64u;
const LEAST_WINDOW: f32 = 1e-2;
// Bits of what is beyond all distances.
const FAR: u32 = 0x7f800000u;
const TINY: f32 = 1e-30;

struct Window {
    piece: vec2<f32>,
    source: vec2<f32>,
    beyond_m: f32,
    is_kept: bool,
}

fn position(vertex: u32) -> vec3<f32> {
    return positions[vertex].xyz;
}

fn no_window() -> Window {
    return Window(vec2<f32>(0.0), vec2<f32>(0.0), 0.0, false);
}

fn window_of(kept: Kept, which: u32) -> Window {
    if which == 0u {
        return Window(kept.first.xy, kept.first.zw, kept.beyond.x, kept.beyond.y > 0.0);
    }
    return Window(kept.second.xy, kept.second.zw, kept.beyond.z, kept.beyond.w > 0.0);
}

// How far a place of the side is, by a way through the window.
fn along(window: Window, place_m: f32) -> f32 {
    let through = clamp(place_m, window.piece.x, window.piece.y);
    return window.beyond_m + distance(window.source, vec2<f32>(through, 0.0)) + abs(place_m - through);
}

// Where the ray from a source before a side to a place behind it crosses it.
fn crossing(source: vec2<f32>, place: vec2<f32>) -> f32 {
    let height = max(source.y - place.y, TINY);
    return source.x + (place.x - source.x) * (source.y / height);
}

// How far a place behind the side is, by the shortest way through the window.
fn beyond(window: Window, place: vec2<f32>) -> f32 {
    let through = vec2<f32>(clamp(crossing(window.source, place), window.piece.x, window.piece.y), 0.0);
    return window.beyond_m + distance(window.source, through) + distance(through, place);
}

// Both as one, where they see the same source and leave no gap; else none.
fn joined(a: Window, b: Window) -> Window {
    let is_same = distance(a.source, b.source) + abs(a.beyond_m - b.beyond_m) <= mesh.same_m;
    let is_near = a.piece.x <= b.piece.y + mesh.same_m && b.piece.x <= a.piece.y + mesh.same_m;
    if !(a.is_kept && b.is_kept && is_same && is_near) {
        return no_window();
    }
    // Of the farther source, so that none is too short.
    var one = a;
    if b.beyond_m > a.beyond_m {
        one = b;
    }
    one.piece = vec2<f32>(min(a.piece.x, b.piece.x), max(a.piece.y, b.piece.y));
    return one;
}

struct Best {
    first: Window,
    second: Window,
}

// How far the side is by both, in the sum over five places of it.
fn nearness(a: Window, b: Window, length_m: f32) -> f32 {
    var sum = 0.0;
    for (var place = 0u; place < 5u; place++) {
        let at_m = 0.25 * f32(place) * length_m;
        sum += min(along(a, at_m), along(b, at_m));
    }
    return sum;
}

// The two windows of all offered ones that together tell the least distances along the side.
fn offer(best: Best, offered: Window, length_m: f32) -> Best {
    if !offered.is_kept {
        return best;
    }
    var kept = best;
    var fresh = offered;
    let with_first = joined(kept.first, fresh);
    if with_first.is_kept {
        kept.first = no_window();
        fresh = with_first;
    }
    let with_second = joined(kept.second, fresh);
    if with_second.is_kept {
        kept.second = no_window();
        fresh = with_second;
    }
    if !kept.first.is_kept {
        kept.first = fresh;
        return kept;
    }
    if !kept.second.is_kept {
        kept.second = fresh;
        return kept;
    }
    let as_they_are = nearness(kept.first, kept.second, length_m);
    let for_second = nearness(kept.first, fresh, length_m);
    let for_first = nearness(kept.second, fresh, length_m);
    if for_second < as_they_are && for_second <= for_first {
        kept.second = fresh;
    } else if for_first < as_they_are {
        kept.first = kept.second;
        kept.second = fresh;
    }
    return kept;
}

// The ends of a half-edge, the lesser first.
fn ends(half_edge: u32) -> vec2<u32> {
    let face = half_edge / 3u;
    let corner = half_edge % 3u;
    let one = corners[3u * face + (corner + 1u) % 3u];
    let other = corners[3u * face + (corner + 2u) % 3u];
    return vec2<u32>(min(one, other), max(one, other));
}

fn length_of(half_edge: u32) -> f32 {
    let side = ends(half_edge);
    return distance(position(side.x), position(side.y));
}

// The corner across in the side's plane: along it from the lesser end, and how far beside it.
fn apex(half_edge: u32) -> vec2<f32> {
    let side = ends(half_edge);
    let origin = position(side.x);
    let axis = normalize(position(side.y) - origin);
    let way = position(corners[half_edge]) - origin;
    return vec2<f32>(dot(way, axis), length(cross(way, axis)));
}

fn perp_dot(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.y - a.y * b.x;
}

// What of a window through a face's side across corner `from_corner` is seen on the side across `to_corner`.
fn handed_on(window: Window, face: u32, from_corner: u32, to_corner: u32) -> Window {
    if !window.is_kept {
        return no_window();
    }
    let first = 3u * face + from_corner;
    let second = 3u * face + to_corner;
    // Both share the corner that is across neither.
    let meeting = corners[3u * face + 3u - from_corner - to_corner];
    let beside = apex(first);
    let tip = vec2<f32>(beside.x, -beside.y);
    let is_at_first = ends(first).x == meeting;
    let end = vec2<f32>(select(length_of(first), 0.0, is_at_first), 0.0);
    // What passes between the shared corner and the ray to the one across.
    let cross_m = crossing(window.source, tip);
    var piece = vec2<f32>(max(window.piece.x, cross_m), window.piece.y);
    if is_at_first {
        piece = vec2<f32>(window.piece.x, min(window.piece.y, cross_m));
    }
    if !(piece.x <= piece.y) {
        return no_window();
    }
    let length_m = length_of(second);
    let way = (tip - end) / length_m;
    var met = vec2<f32>(0.0);
    for (var side = 0u; side < 2u; side++) {
        let ray = vec2<f32>(select(piece.y, piece.x, side == 0u), 0.0) - window.source;
        let across = perp_dot(ray, way);
        let at_m = perp_dot(window.source - end, ray) / -select(across, 1.0, across == 0.0);
        met[side] = clamp(select(at_m, 0.0, across == 0.0), 0.0, length_m);
    }
    let low = min(met.x, met.y);
    let high = max(met.x, met.y);
    if !(high - low >= LEAST_WINDOW * length_m) {
        return no_window();
    }
    let from_end = window.source - end;
    let along_m = dot(from_end, way);
    let before_m = abs(perp_dot(from_end, way));
    if ends(second).x == meeting {
        return Window(vec2<f32>(low, high), vec2<f32>(along_m, before_m), window.beyond_m, true);
    }
    return Window(
        vec2<f32>(length_m - high, length_m - low), vec2<f32>(length_m - along_m, before_m), window.beyond_m, true);
}

fn may_begin(vertex: u32) -> bool {
    return turns[vertex] > FULL_TURN + TURN_SLACK || distances_before[vertex] == 0u;
}

// What looks into a face through a side: what the face before that side hands on to it.
@compute @workgroup_size(64)
fn cs_gather(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let half_edge = index(id, n_groups);
    // Which is a vertex as well: what is known of its distance goes on.
    if half_edge < mesh.n_vertices {
        atomicStore(&distances_after[half_edge], distances_before[half_edge]);
    }
    if half_edge >= 3u * mesh.n_faces {
        return;
    }
    var best = Best(no_window(), no_window());
    let other = opposite[half_edge];
    if other != 0u {
        let out_of = (other - 1u) / 3u;
        let own = (other - 1u) % 3u;
        let length_m = length_of(half_edge);
        let across = corners[other - 1u];
        let across_m = distances_before[across];
        if across_m < FAR && may_begin(across) {
            let window = Window(vec2<f32>(0.0, length_m), apex(other - 1u), bitcast<f32>(across_m), true);
            best = offer(best, window, length_m);
        }
        for (var step = 0u; step < 3u; step++) {
            if step == own {
                continue;
            }
            let kept = kept_before[3u * out_of + step];
            best = offer(best, handed_on(window_of(kept, 0u), out_of, step, own), length_m);
            best = offer(best, handed_on(window_of(kept, 1u), out_of, step, own), length_m);
        }
    }
    let are = vec2<f32>(select(0.0, 1.0, best.first.is_kept), select(0.0, 1.0, best.second.is_kept));
    kept_after[half_edge] = Kept(
        vec4<f32>(best.first.piece, best.first.source),
        vec4<f32>(best.second.piece, best.second.source),
        vec4<f32>(best.first.beyond_m, are.x, best.second.beyond_m, are.y),
    );
}

// How far a face's corner is by what looks into the face across it, and the ends of the side across by one another.
@compute @workgroup_size(64)
fn cs_reach(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n_groups: vec3<u32>) {
    let half_edge = index(id, n_groups);
    if half_edge >= 3u * mesh.n_faces {
        return;
    }
    let face = half_edge / 3u;
    let a = position(corners[3u * face]);
    let b = position(corners[3u * face + 1u]);
    let c = position(corners[3u * face + 2u]);
    if !has_area(a, b, c) {
        return;
    }
    let beside = apex(half_edge);
    let tip = vec2<f32>(beside.x, -beside.y);
    // `kept_before` is what was gathered in this round.
    let kept = kept_before[half_edge];
    for (var which = 0u; which < 2u; which++) {
        let window = window_of(kept, which);
        if window.is_kept {
            atomicMin(&distances_after[corners[half_edge]], bitcast<u32>(max(beyond(window, tip), 0.0)));
        }
    }
    let side = ends(half_edge);
    let length_m = length_of(half_edge);
    let first = distances_before[side.x];
    let second = distances_before[side.y];
    if first < FAR {
        atomicMin(&distances_after[side.y], bitcast<u32>(bitcast<f32>(first) + length_m));
    }
    if second < FAR {
        atomicMin(&distances_after[side.x], bitcast<u32>(bitcast<f32>(second) + length_m));
    }
}
