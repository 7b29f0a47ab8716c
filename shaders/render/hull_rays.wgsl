// Hulls by the rays of the picture's pixels, each cut by every outline along its epipolar line: no geometry, exact to the texel.
#import "common/hull.wgsl"

@group(1) @binding(0) var surface: texture_storage_2d<rgba32uint, write>;
// How many squares of eight pixels a side may show a hull; then of each its column (lower half) and its row.
@group(1) @binding(1) var<storage, read> squares: array<u32>;

// Stretches within a hull that a ray's coverage is made of: one that grazes a fold goes on to what lies behind.
const MOST_STRETCHES: u32 = 4u;
// A ray that leaves the hull goes on from so much further, metres.
const BEYOND_M: f32 = 1e-4;
// Covered by no less is covered.
const COVERED: f32 = 0.995;

// How much of a pixel a stretch of its ray covers: what grazes an outline lies within it by less than half a pixel of the camera's. A
// long one may graze it in the middle and be deep within elsewhere.
fn coverage_of(hull_idx: u32, ray: HullRay, enter: f32, exit: f32) -> f32 {
    let first = hulls[hull_idx].first_view;
    var most = 0.0;
    for (var i = 0u; i < 5u && most < 1.0; i++) {
        // The middle is enough for most.
        let shares = array<f32, 5>(0.5, 0.25, 0.75, 0.125, 0.875);
        let place = ray.origin + ray.direction * mix(enter, exit, shares[i]);
        var coverage = 1.0;
        for (var k = 0u; k < hulls[hull_idx].n_views; k++) {
            coverage = min(coverage, silhouette_texel(first + k, place).x + 0.5);
        }
        most = max(most, coverage);
    }
    return clamp(most, 0.0, 1.0);
}

@compute @workgroup_size(8, 8)
fn cs_main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) within: vec3<u32>,
) {
    let square_idx = group.y * groups.x + group.x;
    if square_idx >= squares[0] {
        return;
    }
    let square = squares[1u + square_idx];
    let id = vec2<u32>(square & 0xffffu, square >> 16u) * 8u + within.xy;
    let size = textureDimensions(surface);
    if any(id >= size) {
        return;
    }
    let pixel = vec2<f32>(id) + 0.5;
    let ray = hull_ray(pixel);
    var texel = vec4<u32>(0u);
    var found = HullSurface(FAR, -ray.direction, 0u, 0.0, 0.0, NO_EDGE);
    // What of the pixel nothing covers.
    var open = 1.0;
    for (var hull_idx = 0u; hull_idx < hull_frame.n_hulls; hull_idx++) {
        let rect = hulls[hull_idx].rect_px;
        if any(pixel < rect.xy) || any(pixel > rect.zw) {
            continue;
        }
        var range = within_bounds(hull_idx, ray);
        let is_eye_within = range.x < VIEW_NEAR_M;
        range.x = max(range.x, VIEW_NEAR_M);
        // Behind what covers the pixel nothing is looked for.
        if open <= 1.0 - COVERED {
            range.y = min(range.y, found.t);
        }
        if range.x >= range.y {
            continue;
        }
        // From the bounds on, so that an eye far away costs no digits.
        let near = HullRay(ray.origin + ray.direction * range.x, ray.direction);
        let length = range.y - range.x;
        var hit = hull_hit(hull_idx, near, vec2<f32>(0.0, length), NO_VIEW);
        // An eye in the hull sees what lies behind it.
        if hit.is_hit && hit.t == 0.0 && is_eye_within {
            hit = hull_hit(hull_idx, near, vec2<f32>(hit.exit + BEYOND_M, length), NO_VIEW);
        }
        if !hit.is_hit {
            continue;
        }
        if range.x + hit.t < found.t {
            found = HullSurface(range.x + hit.t, hit.normal, hull_idx, hit.exit - hit.t, 1.0, hit.edge);
        }
        for (var i = 0u; hit.is_hit && i < MOST_STRETCHES; i++) {
            open *= 1.0 - coverage_of(hull_idx, near, hit.t, hit.exit);
            if open <= 1.0 - COVERED {
                break;
            }
            hit = hull_hit(hull_idx, near, vec2<f32>(hit.exit + BEYOND_M, length), NO_VIEW);
        }
    }
    if found.t < FAR {
        found.coverage = 1.0 - open;
        texel = packed_surface(found);
    }
    textureStore(surface, id, texel);
}
