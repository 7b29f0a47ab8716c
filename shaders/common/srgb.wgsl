// IEC 61966-2-1 on the GPU, where a picture's codes are reckoned with; src/vision/frame/color.rs is its counterpart and specification.

fn srgb_from_linear(light: vec3<f32>) -> vec3<f32> {
    let low = light * 12.92;
    // Of what is small the power is not looked at, and of 0 it is no number on some devices.
    let high = 1.055 * pow(max(light, vec3<f32>(0.003)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(high, low, light <= vec3<f32>(0.0031308));
}

fn linear_from_srgb(code: vec3<f32>) -> vec3<f32> {
    let low = code / 12.92;
    let high = pow((max(code, vec3<f32>(0.04)) + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, code <= vec3<f32>(0.04045));
}
