// The one place on the GPU that knows YUV; src/vision/frame/color.rs is its counterpart and specification.
// [H.273] ITU-T H.273 (2021), Coding-independent code points, equations 20 to 32 and 38 to 40.

// sRGB-coded R'G'B' (0 to 1) of samples in 0 to 1. `rgb_from_ypbpr` has rows R, G, B.
fn srgb_from_yuv(
    yuv: vec3<f32>,
    offset: vec3<f32>,
    gain: vec3<f32>,
    row_r: vec3<f32>,
    row_g: vec3<f32>,
    row_b: vec3<f32>,
) -> vec3<f32> {
    let ypbpr = (yuv - offset) * gain;
    return clamp(vec3<f32>(dot(row_r, ypbpr), dot(row_g, ypbpr), dot(row_b, ypbpr)), vec3<f32>(0.0), vec3<f32>(1.0));
}
