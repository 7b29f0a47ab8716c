// The virtual camera of one frame. Points are relative to the eye, in world axes, metres: 32 bits then hold a
// scene at any map coordinates as well as one at the origin.

struct View {
    // Reversed depth: 1 at the near plane, 0 at infinity.
    clip_from_eye: mat4x4<f32>,
    // Unit vectors of the picture's axes in the world.
    right: vec3<f32>,
    pad_right: u32,
    down: vec3<f32>,
    pad_down: u32,
}

@group(0) @binding(0) var<uniform> view: View;
