// Hulls of entities: their silhouettes' outlines, and how rays are cut by them. src/hull is the counterpart and specification.
// [M00] Matusik et al. 2000, Image-Based Visual Hulls.
#import "common/view.wgsl"
#import "common/camera.wgsl"

// Edges beneath a leaf of an outline's tree: LEAF_EDGES of src/vision/hull/outline.rs.
const LEAF_EDGES: u32 = 8u;
// Most times that a ray goes on to where some camera next lets it be inside.
const MOST_ADVANCES: u32 = 96u;
// Steps of a ray through what no camera sees, as a share of its way through the bounds.
const UNSEEN_STEP: f32 = 0.02;
const FAR: f32 = 1e30;
// Nearer to the eye nothing is drawn: VIEW_NEAR_M of src/render/camera_data.rs.
const VIEW_NEAR_M: f32 = 0.05;
// Of parallel rays, the depth in which cones are told apart.
const PARALLEL_REACH_M: f32 = 4000.0;
const NO_VIEW: u32 = 0xffffffffu;
// In place of the edge of an outline: a side of the bounds, or not known. Texels tell edges up to it, and hulls beside.
const NO_EDGE: u32 = 0xffffffu;
// Thickness that a texel can tell, metres along the ray: MOST_THICKNESS of src/render/found_hulls.rs.
const MOST_THICKNESS: f32 = 16.0;
// Pixels of distance from an outline that its texels tell: REACH_PX of src/vision/hull/distances.rs.
const REACH_PX: f32 = 8.0;

// How a pixel is looked through: `corner` + x `across` + y `along` is the direction of its ray, of 1 along the axis, or where a
// parallel one begins.
struct HullFrame {
    corner: vec3<f32>,
    n_hulls: u32,
    across: vec3<f32>,
    // Depth maps of the views that lie beside each other; 0 without any.
    tile_columns: u32,
    along: vec3<f32>,
    // Of parallel rays, how far the middle of all bounds lies before the plane through the eye.
    middle_m: f32,
}

struct Hull {
    // Bounds from the anchor.
    low: vec3<f32>,
    first_view: u32,
    high: vec3<f32>,
    n_views: u32,
    // What of the picture may show it: left, top, right, bottom.
    rect_px: vec4<f32>,
}

struct HullView {
    camera_idx: u32,
    first_edge: u32,
    first_box: u32,
    // 0 where nothing of the picture is outside the silhouette.
    n_leaves: u32,
    // From the camera's texture coordinates to those of its layer of masks.
    scale: vec2<f32>,
    offset: vec2<f32>,
    // Greatest coordinates of the layer that mean anything.
    limit: vec2<f32>,
    // From the camera's tangent plane to its depth map of the hulls; 0 where it has none.
    tile_scale: vec2<f32>,
    // How far what it shows has moved since the camera saw it: the camera is taken to stand so much further on.
    shift: vec3<f32>,
    layer: u32,
    tile_offset: vec2<f32>,
    pad_tile: vec2<f32>,
}

@group(2) @binding(0) var<storage, read> hull_frame: HullFrame;
@group(2) @binding(1) var<storage, read> hulls: array<Hull>;
@group(2) @binding(2) var<storage, read> hull_views: array<HullView>;
// Both ends of an edge in the camera's tangent plane.
@group(2) @binding(3) var<storage, read> hull_edges: array<vec4<f32>>;
// Lower and upper corner of the edges beneath a node.
@group(2) @binding(4) var<storage, read> hull_boxes: array<vec4<f32>>;
// How far a texel lies within its silhouette: 0.5 on the outline, 1 REACH_PX within; and whether it is inside.
@group(2) @binding(5) var hull_masks: texture_2d_array<f32>;
@group(2) @binding(6) var hull_sampler: sampler;

struct HullRay {
    origin: vec3<f32>,
    // Not of unit length.
    direction: vec3<f32>,
}

fn hull_ray(pixel: vec2<f32>) -> HullRay {
    let offset = hull_frame.corner + hull_frame.across * pixel.x + hull_frame.along * pixel.y;
    let is_parallel = view.is_parallel != 0u;
    return HullRay(select(view.eye_from_anchor, offset, is_parallel), select(offset, view.forward, is_parallel));
}

// Where a ray is within the hull's bounds; the first is greater than the second where it misses them.
fn within_bounds(hull_idx: u32, ray: HullRay) -> vec2<f32> {
    let tiny = vec3<f32>(1e-20);
    let safe = select(ray.direction, tiny, abs(ray.direction) < tiny);
    let a = (hulls[hull_idx].low - ray.origin) / safe;
    let b = (hulls[hull_idx].high - ray.origin) / safe;
    let near = min(a, b);
    let far = max(a, b);
    return vec2<f32>(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}

// A place as a view's camera sees it, and where that camera is taken to stand.
fn seen_by(view_idx: u32, place: vec3<f32>) -> Projection {
    return project(hull_views[view_idx].camera_idx, place - hull_views[view_idx].shift);
}

fn eye_of(view_idx: u32) -> vec3<f32> {
    return cameras[hull_views[view_idx].camera_idx].position_from_anchor + hull_views[view_idx].shift;
}

fn side_of(line: vec3<f32>, at: vec2<f32>) -> f32 {
    return line.x * at.x + line.y * at.y + line.z;
}

// Whether a line meets a node's box; what touches counts, as sums are rounded.
fn meets_box(line: vec3<f32>, corners: vec4<f32>) -> bool {
    let x = line.x * corners.xz;
    let y = line.y * corners.yw;
    let slack = 1e-5 * (abs(x.x) + abs(x.y) + abs(y.x) + abs(y.y) + abs(line.z));
    let least = min(x.x, x.y) + min(y.x, y.y) + line.z;
    let most = max(x.x, x.y) + max(y.x, y.y) + line.z;
    return corners.x <= corners.z && least <= slack && most >= -slack;
}

// The node after one that is done with, or beneath which nothing is met; 0 at the end.
fn next_node(done: u32) -> u32 {
    var node = done;
    while node != 0u && (node & 1u) == 0u {
        node = (node - 1u) / 2u;
    }
    return select(node + 1u, 0u, node == 0u);
}

struct Probe {
    // Whether the camera sees the place outside the silhouette.
    is_outside: bool,
    // The next two changes along the ray, and the edge at which the first is.
    next: f32,
    after: f32,
    edge: u32,
}

// What a view says of a place `t` along a ray. Crossings are compared by where they lie along the ray, the same numbers whatever
// place is asked for: a ray that has gone on to one is beyond it.
fn probe(view_idx: u32, ray: HullRay, t: f32) -> Probe {
    let camera_idx = hull_views[view_idx].camera_idx;
    let start = vec4<f32>(ray.origin - hull_views[view_idx].shift, 1.0);
    let x = cameras[camera_idx].row_x;
    let y = cameras[camera_idx].row_y;
    let z = cameras[camera_idx].row_z;
    var o = vec3<f32>(dot(x, start), dot(y, start), dot(z, start));
    let d = vec3<f32>(dot(x.xyz, ray.direction), dot(y.xyz, ray.direction), dot(z.xyz, ray.direction));
    var line = cross(o, d);
    // A ray through the camera is seen as a point; beside it by a ten thousandth it is a short line, and means the same.
    let least = 1e-4 * max(length(o), 1.0);
    if dot(line, line) < least * least * dot(d, d) {
        let beside = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(d.x) > abs(d.y));
        o += normalize(cross(d, beside)) * (2.0 * least);
        line = cross(o, d);
    }
    var found = Probe(false, FAR, FAR, 0u);
    let n_leaves = hull_views[view_idx].n_leaves;
    let steepness = length(line.xy);
    if n_leaves == 0u || steepness <= 1e-12 * length(line) {
        return found;
    }
    // Along the line, as the distance along the ray grows.
    let along = vec2<f32>(line.y, -line.x) / steepness;
    let o_along = dot(o.xy, along);
    let d_along = dot(d.xy, along);
    let comes_nearer = d.z < 0.0;
    let first_box = hull_views[view_idx].first_box;
    let first_edge = hull_views[view_idx].first_edge;
    var n_passed = 0u;
    var node = 0u;
    loop {
        if meets_box(line, hull_boxes[first_box + node]) {
            if node + 1u < n_leaves {
                node = 2u * node + 1u;
                continue;
            }
            let leaf = first_edge + (node + 1u - n_leaves) * LEAF_EDGES;
            for (var i = 0u; i < LEAF_EDGES; i++) {
                let edge = hull_edges[leaf + i];
                let a = side_of(line, edge.xy);
                let b = side_of(line, edge.zw);
                if (a >= 0.0) == (b >= 0.0) {
                    continue;
                }
                let s = dot(mix(edge.xy, edge.zw, a / (a - b)), along);
                let growth = d_along - s * d.z;
                // What else is crossed lies behind the camera.
                if growth <= 0.0 {
                    continue;
                }
                let at = (s * o.z - o_along) / growth;
                n_passed += u32((at > t) == comes_nearer);
                if at > t {
                    if at < found.next {
                        found.after = found.next;
                        found.next = at;
                        found.edge = leaf + i;
                    } else if at < found.after {
                        found.after = at;
                    }
                }
            }
        }
        node = next_node(node);
        if node == 0u {
            break;
        }
    }
    found.is_outside = (n_passed & 1u) == 1u;
    return found;
}

// The direction in the world of the plane through a camera and an edge of its outline, towards where the ray comes from.
fn edge_normal(view_idx: u32, edge_idx: u32, direction: vec3<f32>) -> vec3<f32> {
    let edge = hull_edges[edge_idx];
    let local = cross(vec3<f32>(edge.xy, 1.0), vec3<f32>(edge.zw, 1.0));
    let camera_idx = hull_views[view_idx].camera_idx;
    let world = cameras[camera_idx].row_x.xyz * local.x + cameras[camera_idx].row_y.xyz * local.y
        + cameras[camera_idx].row_z.xyz * local.z;
    let normal = world / max(length(world), 1e-30);
    return select(normal, -normal, dot(normal, direction) > 0.0);
}

struct HullHit {
    is_hit: bool,
    // Where the ray comes into the hull, and where it first leaves it again.
    t: f32,
    exit: f32,
    normal: vec3<f32>,
    // Where it comes in, or NO_EDGE.
    edge: u32,
}

// The first place between two, within its bounds, at which a ray is in the hull by all of its views but one.
fn hull_hit(hull_idx: u32, ray: HullRay, range: vec2<f32>, but: u32) -> HullHit {
    let first = hulls[hull_idx].first_view;
    let n_views = hulls[hull_idx].n_views;
    let toward = -ray.direction / length(ray.direction);
    var hit = HullHit(false, range.x, range.y, toward, NO_EDGE);
    if range.x >= range.y {
        return hit;
    }
    var n_agreed = 0u;
    var view_idx = 0u;
    var n_advances = 0u;
    loop {
        if n_agreed >= n_views {
            var is_seen = but != NO_VIEW;
            for (var k = 0u; k < n_views && !is_seen; k++) {
                let seen = seen_by(first + k, ray.origin + ray.direction * hit.t);
                is_seen = seen.is_seen && all(seen.texture >= vec2<f32>(0.0)) && all(seen.texture <= vec2<f32>(1.0));
            }
            if is_seen {
                hit.is_hit = true;
                return hit;
            }
            hit.t += (range.y - range.x) * UNSEEN_STEP;
            hit.normal = toward;
            hit.edge = NO_EDGE;
            hit.exit = range.y;
            n_agreed = 0u;
            n_advances++;
        }
        if hit.t >= range.y || n_advances >= MOST_ADVANCES {
            return hit;
        }
        let at = first + view_idx;
        if at != but {
            let found = probe(at, ray, hit.t);
            if found.is_outside {
                hit.t = found.next;
                hit.exit = min(range.y, found.after);
                hit.normal = edge_normal(at, found.edge, ray.direction);
                hit.edge = found.edge;
                n_agreed = 0u;
                n_advances++;
            } else {
                hit.exit = min(hit.exit, found.next);
            }
        }
        n_agreed++;
        view_idx = select(view_idx + 1u, 0u, view_idx + 1u >= n_views);
    }
    return hit;
}

// What a view's texels say of a place: how far within the silhouette it is seen, pixels from -REACH_PX to REACH_PX; and the mask
// between its pixels, which is one half on the outline. Where the view does not see the place, that it is well within.
fn silhouette_texel(view_idx: u32, place: vec3<f32>) -> vec2<f32> {
    let seen = seen_by(view_idx, place);
    let is_beside = !seen.is_seen || any(seen.texture < vec2<f32>(0.0)) || any(seen.texture > vec2<f32>(1.0));
    let at = seen.texture * hull_views[view_idx].scale + hull_views[view_idx].offset;
    let coded = textureSampleLevel(
        hull_masks, hull_sampler, clamp(at, vec2<f32>(0.0), hull_views[view_idx].limit), hull_views[view_idx].layer, 0.0,
    ).rg;
    return select(vec2<f32>((2.0 * coded.x - 1.0) * REACH_PX, coded.y), vec2<f32>(REACH_PX, 1.0), is_beside);
}

// The surface nearest to the eye at a pixel, as every method tells it.
struct HullSurface {
    // Along the pixel's ray.
    t: f32,
    normal: vec3<f32>,
    hull_idx: u32,
    // How far the ray stays within; 0 where that is not known.
    thickness: f32,
    coverage: f32,
    // Of an outline whose cone's face it is, or NO_EDGE.
    edge: u32,
}

// Unit vectors as two numbers: [C14] Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit Vectors.
fn octahedral(v: vec3<f32>) -> vec2<f32> {
    let p = v.xy / max(abs(v.x) + abs(v.y) + abs(v.z), 1e-30);
    let signs = select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return select(p, (vec2<f32>(1.0) - abs(p.yx)) * signs, v.z < 0.0);
}

fn from_octahedral(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let signs = select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    let xy = select(p, (vec2<f32>(1.0) - abs(p.yx)) * signs, z < 0.0);
    return normalize(vec3<f32>(xy, z));
}

fn packed_surface(surface: HullSurface) -> vec4<u32> {
    return vec4<u32>(
        bitcast<u32>(surface.t), pack2x16snorm(octahedral(surface.normal)),
        (surface.hull_idx + 1u) << 24u | min(surface.edge, NO_EDGE),
        pack2x16unorm(vec2<f32>(surface.thickness / MOST_THICKNESS, surface.coverage)),
    );
}

fn unpacked_surface(texel: vec4<u32>) -> HullSurface {
    let more = unpack2x16unorm(texel.w) * vec2<f32>(MOST_THICKNESS, 1.0);
    return HullSurface(
        bitcast<f32>(texel.x), from_octahedral(unpack2x16snorm(texel.y)), (texel.z >> 24u) - 1u, more.x, more.y,
        texel.z & NO_EDGE,
    );
}
