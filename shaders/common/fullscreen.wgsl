// One triangle that covers the target.

fn fullscreen_position(vertex_idx: u32) -> vec4<f32> {
    let corner = vec2<f32>(f32((vertex_idx << 1u) & 2u), f32(vertex_idx & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}
