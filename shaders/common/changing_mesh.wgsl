// A mesh that is another from frame to frame, and the cameras that lend to it: what passes over it have in common.
// src/fields is the specification of all of them.
//
// By vertex and view are lists whose entry is the vertex times the number of views, and the view.

// Most cameras of one mesh: MAX_VIEWS of src/vision/fields/view.rs.
const MOST_VIEWS: u32 = 64u;

// What a camera has to say of a vertex: Sight of src/vision/fields/sight.rs.
const SEEN: u32 = 0u;
const OUTVOTED: u32 = 1u;
const NEAR: u32 = 2u;
const HIDDEN: u32 = 3u;
const BESIDE: u32 = 4u;

// How hidden vertices are found: Visibility of src/vision/fields/sight.rs, but for rays.
const BY_FACING: u32 = 0u;
const BY_DILATED_DEPTHS: u32 = 2u;

struct MeshCamera {
    // Where it stands, from the mesh's origin, metres.
    eye: vec3<f32>,
    // Its place among the frame's cameras.
    camera_idx: u32,
    // Texels of its depth map.
    map_px: vec2<f32>,
    // One more than its place among the cameras of the mesh before; 0 if it was not one.
    was: u32,
    // Whether it shows something now.
    is_shown: u32,
}

struct ChangingMesh {
    // What makes a place from the mesh's origin one from the anchor, metres.
    shift: vec3<f32>,
    n_vertices: u32,
    n_faces: u32,
    n_views: u32,
    // How far from its seams a camera lends in full, metres.
    reach_m: f32,
    // How wrong depths are taken to be, metres.
    depth_m: f32,
    // Where the viewer stands, from the mesh's origin; of parallel rays the direction to it.
    viewer: vec3<f32>,
    is_parallel: u32,
    // Share of the way to what weights should be that is gone now.
    follow: f32,
    is_montage: u32,
    // How hidden vertices are found.
    visibility: u32,
    // Whether cameras lend less towards their seams.
    has_ramps: u32,
    // Of the mesh before: its vertices, how many views it had, and the width of a cell in which they are looked for.
    n_before: u32,
    n_views_before: u32,
    cell_m: f32,
    // The table of cells has one more slots, a power of two.
    table_mask: u32,
    // Power of the cosine by which who looks squarely counts more.
    normal_exponent: f32,
    // Cameras that are mixed at a place, at most.
    most_cameras: u32,
    pad_a: u32,
    pad_b: u32,
    cameras: array<MeshCamera, MOST_VIEWS>,
}

@group(1) @binding(0) var<storage, read> mesh: ChangingMesh;
