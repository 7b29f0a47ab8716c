// The virtual camera of one frame. Points are relative to an anchor, in world axes, metres: 32 bits then hold a scene
// at any map coordinates as well as one at the origin. The anchor is the eye, or lies before an eye that is far away.

struct View {
    // Reversed depth: near plane over distance; for parallel rays and far eyes from 1 where the scene begins to 0 where
    // it ends.
    clip_from_anchor: mat4x4<f32>,
    // Unit vectors of the picture's axes in the world.
    right: vec3<f32>,
    // 1 where all rays run along `forward` (orthographic), 0 where they meet in the eye.
    is_parallel: u32,
    down: vec3<f32>,
    pad_down: u32,
    forward: vec3<f32>,
    pad_forward: u32,
    eye_from_anchor: vec3<f32>,
    pad_eye: u32,
}

@group(0) @binding(0) var<uniform> view: View;

// Unit vector from a point towards the viewer; zero in the eye itself.
fn to_viewer_from(point_from_anchor: vec3<f32>) -> vec3<f32> {
    let to_eye = view.eye_from_anchor - point_from_anchor;
    return select(to_eye / max(length(to_eye), 1e-12), -view.forward, view.is_parallel != 0u);
}
