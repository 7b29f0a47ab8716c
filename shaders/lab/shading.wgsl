// Ground that cameras' pictures lie on, shaded by fragments or by threads that compute: the same function for both, with the
// arithmetic of render/surface.wgsl for a camera (projection, inset, weights' fifth powers, one look at its picture).

struct Camera {
    clip_from_world: mat4x4<f32>,
    position: vec4<f32>,
}

struct Scene {
    // Eye, and the directions to the middle of the picture and half its width and height.
    eye: vec4<f32>,
    forward: vec4<f32>,
    right: vec4<f32>,
    up: vec4<f32>,
    size_px: vec2<u32>,
    n_cameras: u32,
    padding: u32,
    cameras: array<Camera, 8>,
}

@group(0) @binding(0) var<storage, read> scene: Scene;
@group(0) @binding(1) var pictures: texture_2d_array<f32>;
@group(0) @binding(2) var picture_sampler: sampler;
@group(0) @binding(3) var drawn: texture_storage_2d<rgba8unorm, write>;

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    return x2 * x2 * x;
}

// The colour of a pixel, linear; sky above the horizon.
fn shaded(pixel: vec2<f32>) -> vec3<f32> {
    let place = pixel / vec2<f32>(scene.size_px) * 2.0 - 1.0;
    let direction = scene.forward.xyz + place.x * scene.right.xyz - place.y * scene.up.xyz;
    if direction.z > -1e-4 {
        return vec3<f32>(0.2, 0.35, 0.6);
    }
    let point = scene.eye.xyz - direction * (scene.eye.z / direction.z);
    let to_viewer = -normalize(direction);
    var sum = vec3<f32>(0.0);
    var sum_of_weights = 0.0;
    for (var k = 0u; k < scene.n_cameras; k++) {
        let clip = scene.cameras[k].clip_from_world * vec4<f32>(point, 1.0);
        let texture = clip.xy / clip.w * vec2<f32>(0.5, -0.5) + 0.5;
        let inset = min(texture, 1.0 - texture);
        let border = min(inset.x, inset.y);
        let to_camera = normalize(scene.cameras[k].position.xyz - point);
        if !(clip.w > 0.0 && border >= 0.0 && to_camera.z > 0.0) {
            continue;
        }
        let color = textureSampleLevel(pictures, picture_sampler, texture, k, 0.0).rgb;
        let between = to_camera + to_viewer;
        let weight = fifth_power(to_camera.z * 0.5 * dot(between, between)) * smoothstep(0.0, 0.06, border);
        sum += weight * color;
        sum_of_weights += weight;
    }
    return select(vec3<f32>(0.2), sum / max(sum_of_weights, 1e-30), sum_of_weights > 0.0);
}

@vertex
fn vs_main(@builtin(vertex_index) idx: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2<f32>(f32((idx << 1u) & 2u), f32(idx & 2u));
    return vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fs_main(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(shaded(position.xy), 1.0);
}

@compute @workgroup_size(8, 8)
fn cs_tiles(@builtin(global_invocation_id) id: vec3<u32>) {
    shade(id.xy);
}

@compute @workgroup_size(64, 1)
fn cs_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    shade(id.xy);
}

fn shade(pixel: vec2<u32>) {
    if all(pixel < scene.size_px) {
        textureStore(drawn, pixel, vec4<f32>(shaded(vec2<f32>(pixel) + 0.5), 1.0));
    }
}
