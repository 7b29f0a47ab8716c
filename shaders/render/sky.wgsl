// What is seen where nothing stands: drawn behind everything, at the depth of infinity.
#import "common/view.wgsl"
#import "common/fullscreen.wgsl"

struct Sky {
    // Colours of a gradient, linear light.
    zenith: vec3<f32>,
    // Of a picture: where its middle column looks, from east towards north.
    yaw_rad: f32,
    horizon: vec3<f32>,
    pad_horizon: u32,
    ground: vec3<f32>,
    pad_ground: u32,
    // What the view spans, tangents off its axis: left, right, top, bottom.
    span: vec4<f32>,
}

@group(1) @binding(0) var<uniform> sky: Sky;
// Equirectangular.
@group(2) @binding(0) var picture: texture_2d<f32>;
@group(2) @binding(1) var picture_sampler: sampler;

const PI: f32 = 3.141592653589793;
// Below the horizon the ground's colour counts in full from this sine on: one degree.
const HAZE: f32 = 0.0174524;

struct Varying {
    @builtin(position) position: vec4<f32>,
    // On the plane at distance 1 before the eye.
    @location(0) on_plane: vec2<f32>,
}

@vertex
fn vs_main(@builtin(vertex_index) vertex_idx: u32) -> Varying {
    let position = fullscreen_position(vertex_idx);
    let across = 0.5 + 0.5 * position.x;
    let down = 0.5 - 0.5 * position.y;
    return Varying(position, vec2<f32>(mix(sky.span.x, sky.span.y, across), mix(sky.span.z, sky.span.w, down)));
}

// Unit vector of the pixel's ray in the world.
fn direction_of(on_plane: vec2<f32>) -> vec3<f32> {
    let through_eye = normalize(view.right * on_plane.x + view.down * on_plane.y + view.forward);
    return select(through_eye, view.forward, view.is_parallel != 0u);
}

@fragment
fn fs_gradient(in: Varying) -> @location(0) vec4<f32> {
    let height = direction_of(in.on_plane).z;
    let above = mix(sky.horizon, sky.zenith, max(height, 0.0));
    return vec4<f32>(mix(above, sky.ground, smoothstep(0.0, HAZE, -height)), 1.0);
}

@fragment
fn fs_picture(in: Varying) -> @location(0) vec4<f32> {
    let direction = direction_of(in.on_plane);
    let across = length(direction.xy);
    // Straight up and down every column is the same place.
    let azimuth = select(sky.yaw_rad, atan2(direction.y, direction.x), across > 1e-6);
    let place = vec2<f32>(0.5 - (azimuth - sky.yaw_rad) / (2.0 * PI), 0.5 - atan2(direction.z, across) / PI);
    // By angles on the sphere, not by steps in the picture: these leap at its seam and at its poles.
    let x = dpdx(direction);
    let y = dpdy(direction);
    let pixel_rad = sqrt(max(dot(x, x), dot(y, y)));
    let level = max(log2(max(pixel_rad * f32(textureDimensions(picture).y) / PI, 1e-6)), 0.0);
    return vec4<f32>(textureSampleLevel(picture, picture_sampler, place, level).rgb, 1.0);
}
