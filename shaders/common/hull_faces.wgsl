// Faces of silhouettes' cones, and of the bounds that they are cut off at.
#import "common/hull.wgsl"

struct HullFace {
    // Hull; view, or NO_VIEW for one of the six sides of the bounds; edge, or side.
    @location(0) face: vec3<u32>,
}

struct FaceVarying {
    @builtin(position) position: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) @interpolate(flat) face: vec3<u32>,
}

// Masks between texels are one half on an outline, and down to 7/16 where it cuts off a corner: what is trimmed there would leave
// cracks where cones meet, and holes where two cameras stand in one place.
const LEAST_MASK: f32 = 0.42;
// Bounds are drawn by this share larger, and told by their own: sides that touch them are not lost to rounding.
const WIDER: f32 = 1e-4;

// Nearest and farthest plane before a view's camera between which the bounds lie, metres along its axis.
fn reach_of(hull_idx: u32, view_idx: u32) -> vec2<f32> {
    let middle = 0.5 * (hulls[hull_idx].low + hulls[hull_idx].high);
    let radius = 0.5 * length(hulls[hull_idx].high - hulls[hull_idx].low);
    let camera_idx = hull_views[view_idx].camera_idx;
    let along = dot(cameras[camera_idx].row_z, vec4<f32>(middle - hull_views[view_idx].shift, 1.0));
    return vec2<f32>(max(along - radius, CAMERA_NEAR_M), along + radius);
}

fn from_camera_axes(camera_idx: u32, local: vec3<f32>) -> vec3<f32> {
    return cameras[camera_idx].row_x.xyz * local.x + cameras[camera_idx].row_y.xyz * local.y
        + cameras[camera_idx].row_z.xyz * local.z;
}

// A corner of a face's strip, from the anchor.
fn face_corner(corner: u32, face: vec3<u32>) -> vec3<f32> {
    let first = (corner & 1u) != 0u;
    let second = (corner & 2u) != 0u;
    if face.y == NO_VIEW {
        let axis = face.z / 2u;
        let is_high = (face.z & 1u) != 0u;
        let middle = 0.5 * (hulls[face.x].low + hulls[face.x].high);
        let half = 0.5 * (1.0 + WIDER) * (hulls[face.x].high - hulls[face.x].low);
        var signs = vec3<f32>(select(-1.0, 1.0, is_high));
        signs[(axis + 1u) % 3u] = select(-1.0, 1.0, first);
        signs[(axis + 2u) % 3u] = select(-1.0, 1.0, second);
        return middle + half * signs;
    }
    let edge = hull_edges[face.z];
    let reach = reach_of(face.x, face.y);
    let depth = select(reach.x, reach.y, second);
    let local = vec3<f32>(select(edge.xy, edge.zw, first), 1.0) * depth;
    return eye_of(face.y) + from_camera_axes(hull_views[face.y].camera_idx, local);
}

fn face_vertex(corner: u32, in: HullFace) -> FaceVarying {
    let place = face_corner(corner, in.face);
    return FaceVarying(view.clip_from_anchor * vec4<f32>(place, 1.0), place, in.face);
}

// Out of the hull, of unit length. Outlines have the silhouette on the right of each edge, rows running downwards.
fn face_normal(face: vec3<u32>) -> vec3<f32> {
    if face.y == NO_VIEW {
        var normal = vec3<f32>(0.0);
        normal[face.z / 2u] = select(-1.0, 1.0, (face.z & 1u) != 0u);
        return normal;
    }
    let edge = hull_edges[face.z];
    let inwards = from_camera_axes(
        hull_views[face.y].camera_idx, cross(vec3<f32>(edge.xy, 1.0), vec3<f32>(edge.zw, 1.0)),
    );
    return -inwards / max(length(inwards), 1e-30);
}

// The edge whose cone's face it is, or NO_EDGE.
fn edge_of(face: vec3<u32>) -> u32 {
    return select(face.z, NO_EDGE, face.y == NO_VIEW);
}

// Whether all silhouettes but the face's own hold a place on it.
fn is_held(face: vec3<u32>, place: vec3<f32>) -> bool {
    let first = hulls[face.x].first_view;
    for (var k = 0u; k < hulls[face.x].n_views; k++) {
        if first + k != face.y {
            if silhouette_texel(first + k, place).y < LEAST_MASK {
                return false;
            }
        }
    }
    return true;
}

fn is_within_hull_bounds(hull_idx: u32, place: vec3<f32>) -> bool {
    let slack = WIDER * (hulls[hull_idx].high - hulls[hull_idx].low);
    return all(place >= hulls[hull_idx].low - slack) && all(place <= hulls[hull_idx].high + slack);
}
