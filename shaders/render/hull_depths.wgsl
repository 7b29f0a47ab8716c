// What every camera sees of the hulls, as depth maps beside each other: reference depths of trimmed cones (Li, Magnor and Seidel 2004,
// section 4.3). A view's map is drawn by the four vertices that begin at four times its index.
#import "common/hull_faces.wgsl"

struct DepthVarying {
    @builtin(position) position: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) @interpolate(flat) face: vec3<u32>,
    @location(2) @interpolate(flat) view_idx: u32,
}

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32, in: HullFace) -> DepthVarying {
    let view_idx = vertex_idx / 4u;
    let camera_idx = hull_views[view_idx].camera_idx;
    let place = face_corner(vertex_idx % 4u, in.face);
    let from_anchor = vec4<f32>(place - hull_views[view_idx].shift, 1.0);
    let local = vec3<f32>(
        dot(cameras[camera_idx].row_x, from_anchor), dot(cameras[camera_idx].row_y, from_anchor),
        dot(cameras[camera_idx].row_z, from_anchor),
    );
    let share = local.xy * hull_views[view_idx].tile_scale + local.z * hull_views[view_idx].tile_offset;
    var position = vec4<f32>(2.0 * share.x - local.z, local.z - 2.0 * share.y, CAMERA_NEAR_M, local.z);
    // Faces of its own cones a camera sees from their edges.
    var is_own = false;
    if in.face.y != NO_VIEW {
        is_own = hull_views[in.face.y].camera_idx == camera_idx;
    }
    if is_own {
        position = vec4<f32>(0.0, 0.0, -1.0, 1.0);
    }
    return DepthVarying(position, place, in.face, view_idx);
}

@fragment
fn fs_main(in: DepthVarying) {
    if !is_within_hull_bounds(in.face.x, in.place) {
        discard;
    }
    if dot(face_normal(in.face), in.place - eye_of(in.view_idx)) >= 0.0 {
        discard;
    }
    if !is_held(in.face, in.place) {
        discard;
    }
}
