// What every camera of a changing mesh sees of it first: a layer of reversed depths each, in the camera's own picture.
// src/vision/mesh/raster.rs is the specification. Sides are drawn straight between their ends, whatever the lens.
#import "common/camera.wgsl"
#import "common/changing_mesh.wgsl"

// By part and view: what a camera of a part has moved by (xyz), and whether it is one (w).
@group(1) @binding(1) var<storage, read> shifts: array<vec4<f32>>;

// w: the part of the mesh that the vertex is of, by number.
@vertex
fn vs_main(@location(0) place: vec4<f32>, @builtin(instance_index) view_idx: u32) -> @builtin(position) vec4<f32> {
    let camera_idx = mesh.cameras[view_idx].camera_idx;
    let moved = shifts[u32(place.w) * mesh.n_views + view_idx].xyz;
    let seen = project(camera_idx, place.xyz + mesh.shift - moved);
    // Without a lens what reaches behind the camera is cut where it passes it; with one, corners that it does not see are.
    let z = seen.local.z;
    var scaled = cameras[camera_idx].focal * seen.local.xy + cameras[camera_idx].center * z;
    if HAS_LENSES && cameras[camera_idx].model != MODEL_PINHOLE {
        if !(seen.is_seen && z > CAMERA_NEAR_M) {
            return vec4<f32>(0.0, 0.0, -1.0, 1.0);
        }
        scaled = seen.texture * z;
    }
    return vec4<f32>(2.0 * scaled.x - z, z - 2.0 * scaled.y, CAMERA_NEAR_M, z);
}
