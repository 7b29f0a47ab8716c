// Ground and boxes with the cameras' backgrounds projected on them.
//
// Per fragment, for camera k: W_k = V W_f W_s W_d; colour = sum W_k T_k / sum W_k, after "Hybrid" (2004) sections
// 4.3 and 4.4, W_s = max(d_k . n, 0)^5, W_d = (d_k . d_v + 1)^5. Where every weight vanishes: the camera that sees
// the surface most squarely, then the material.
#import "common/view.wgsl"
#import "common/camera.wgsl"

// rg: depth and dilated depth of camera_depth.wgsl.
@group(1) @binding(0) var backgrounds: texture_2d_array<f32>;
@group(1) @binding(1) var background_sampler: sampler;
@group(1) @binding(2) var depth_maps: texture_2d_array<f32>;

// Distance from the border at which a picture counts in full, share of its size.
const FEATHER: f32 = 0.06;
// A feather below this counts as beside the picture, so that the sum of weights cannot underflow.
const LEAST_FEATHER: f32 = 1e-6;
// Near plane of the depth maps, metres: passes/camera_depth.rs.
const DEPTH_NEAR_M: f32 = 0.05;

struct VertexIn {
    @location(0) position_from_eye: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) material: vec3<f32>,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    // At the covered part of the pixel, so that nothing beyond the surface's edge is projected.
    @location(0) @interpolate(perspective, centroid) position_from_eye: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) @interpolate(flat) material: vec3<f32>,
}

@vertex
fn vs_main(in: VertexIn) -> Varying {
    let position = view.clip_from_eye * vec4<f32>(in.position_from_eye, 1.0);
    return Varying(position, in.position_from_eye, in.normal, in.material);
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    return x2 * x2 * x;
}

fn feather(texture: vec2<f32>) -> f32 {
    let inset = min(texture, 1.0 - texture);
    return smoothstep(0.0, FEATHER, min(inset.x, inset.y));
}

struct DepthPlace {
    // Coordinate in the face, [0, 1]^2 inside.
    texture: vec2<f32>,
    layer: u32,
    distance_m: f32,
    // Tangent that a texel covers.
    texel_tangent: f32,
}

fn depth_place(camera_idx: u32, local: vec3<f32>) -> DepthPlace {
    var bounds = cameras[camera_idx].depth_bounds;
    var on_face = local;
    var face = 0u;
    if cameras[camera_idx].n_depth_faces == 6u {
        // The rotations are those of FACE_FROM_CAMERA in passes/camera_depth.rs.
        let size = abs(local);
        if size.z >= size.x && size.z >= size.y {
            face = select(0u, 1u, local.z < 0.0);
            on_face = select(local, vec3<f32>(-local.x, local.y, -local.z), local.z < 0.0);
        } else if size.x >= size.y {
            face = select(2u, 3u, local.x < 0.0);
            on_face = select(
                vec3<f32>(-local.z, local.y, local.x), vec3<f32>(local.z, local.y, -local.x), local.x < 0.0);
        } else {
            face = select(4u, 5u, local.y < 0.0);
            on_face = select(
                vec3<f32>(local.x, -local.z, local.y), vec3<f32>(local.x, local.z, -local.y), local.y < 0.0);
        }
    }
    let tangent = (on_face.xy / on_face.z - bounds.xy) / bounds.zw;
    var layer = 0u;
    if face < 4u {
        layer = cameras[camera_idx].depth_layers_low[face];
    } else {
        layer = cameras[camera_idx].depth_layers_high[face - 4u];
    }
    let size = f32(textureDimensions(depth_maps).x);
    return DepthPlace(tangent * 0.5 + 0.5, layer, on_face.z, 2.0 * max(bounds.z, bounds.w) / size);
}

fn load_depth(place: DepthPlace, texel: vec2<i32>) -> vec2<f32> {
    let last = vec2<i32>(textureDimensions(depth_maps)) - 1;
    return textureLoad(depth_maps, clamp(texel, vec2<i32>(0), last), place.layer, 0).rg;
}

// V: the share of the four nearest texels of the dilated map that nothing stands before. The bias grows with the
// slope of the surface to the camera (the tangent of the angle of incidence).
fn visibility(camera_idx: u32, local: vec3<f32>, cosine: f32) -> f32 {
    if cameras[camera_idx].n_depth_faces == 0u {
        return 1.0;
    }
    let place = depth_place(camera_idx, local);
    if any(place.texture < vec2<f32>(0.0)) || any(place.texture > vec2<f32>(1.0)) || place.distance_m <= DEPTH_NEAR_M {
        return 1.0;
    }
    let incidence = sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 0.02);
    let bias = 1.0 + 1e-3 + 2.0 * place.texel_tangent * incidence;
    let limit = bias * DEPTH_NEAR_M / place.distance_m;
    let at = place.texture * vec2<f32>(textureDimensions(depth_maps)) - 0.5;
    let corner = vec2<i32>(floor(at));
    let share = fract(at);
    let open = vec4<f32>(
        step(load_depth(place, corner).g, limit),
        step(load_depth(place, corner + vec2<i32>(1, 0)).g, limit),
        step(load_depth(place, corner + vec2<i32>(0, 1)).g, limit),
        step(load_depth(place, corner + vec2<i32>(1, 1)).g, limit),
    );
    return mix(mix(open.x, open.y, share.x), mix(open.z, open.w, share.x), share.y);
}

// As `visibility`, by the map as it is: nothing is dilated.
fn is_visible(camera_idx: u32, local: vec3<f32>, cosine: f32) -> bool {
    if cameras[camera_idx].n_depth_faces == 0u {
        return true;
    }
    let place = depth_place(camera_idx, local);
    if any(place.texture < vec2<f32>(0.0)) || any(place.texture > vec2<f32>(1.0)) || place.distance_m <= DEPTH_NEAR_M {
        return true;
    }
    let incidence = sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 0.02);
    let bias = 1.0 + 1e-3 + 2.0 * place.texel_tangent * incidence;
    let texel = vec2<i32>(place.texture * vec2<f32>(textureDimensions(depth_maps)));
    return load_depth(place, texel).r <= bias * DEPTH_NEAR_M / place.distance_m;
}

// Pixels of the camera's picture that a step (metres, world axes) at `local` crosses.
fn crossed_px(camera_idx: u32, local: vec3<f32>, step_from_eye: vec3<f32>) -> f32 {
    let moved = vec3<f32>(
        dot(cameras[camera_idx].row_x.xyz, step_from_eye),
        dot(cameras[camera_idx].row_y.xyz, step_from_eye),
        dot(cameras[camera_idx].row_z.xyz, step_from_eye),
    );
    let focal_px = cameras[camera_idx].focal * cameras[camera_idx].background_size_px;
    if cameras[camera_idx].model == MODEL_FISHEYE {
        return focal_px.x * length(cross(local, moved)) / max(dot(local, local), 1e-12);
    }
    return length(focal_px * (moved.xy - local.xy * (moved.z / local.z)) / local.z);
}

fn background(camera_idx: u32, texture: vec2<f32>, level: f32) -> vec3<f32> {
    let place = texture * cameras[camera_idx].background_scale;
    return textureSampleLevel(backgrounds, background_sampler, place, cameras[camera_idx].background_layer, level).rgb;
}

fn level_of_detail(camera_idx: u32, local: vec3<f32>, step_x: vec3<f32>, step_y: vec3<f32>) -> f32 {
    // The geometric mean of the footprint's sides: between blurring its short side and aliasing along its long.
    let area = crossed_px(camera_idx, local, step_x) * crossed_px(camera_idx, local, step_y);
    return max(0.5 * log2(max(area, 1e-12)), 0.0);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    let point = in.position_from_eye;
    let step_x = dpdx(point);
    let step_y = dpdy(point);
    let to_viewer = -point / max(length(point), 1e-12);
    let normal = select(-in.normal, in.normal, dot(in.normal, to_viewer) >= 0.0);

    // Weights are fifth powers of s_k = (d_k . n) (d_k . d_v + 1). They are summed relative to the greatest s met so
    // far, and the sums rescaled when a greater one comes: no underflow, whatever the angles.
    var sum = vec3<f32>(0.0);
    var sum_of_weights = 0.0;
    var greatest = 0.0;
    for (var k = 0u; k < view.n_surface_cameras; k++) {
        let to_camera = normalize(cameras[k].position_from_eye - point);
        let cosine = dot(to_camera, normal);
        // d_k . d_v + 1, without the cancellation where camera and viewer face each other.
        let between = to_camera + to_viewer;
        let s = cosine * 0.5 * dot(between, between);
        if !(cosine > 0.0 && s > 0.0) {
            continue;
        }
        let projection = project(k, point);
        if !projection.is_seen {
            continue;
        }
        let border = feather(projection.texture);
        if !(border > LEAST_FEATHER) {
            continue;
        }
        let share = border * visibility(k, projection.local, cosine);
        if !(share > LEAST_FEATHER) {
            continue;
        }
        if s > greatest {
            let rescale = fifth_power(greatest / s);
            sum *= rescale;
            sum_of_weights *= rescale;
            greatest = s;
        }
        let weight = share * fifth_power(s / greatest);
        let level = level_of_detail(k, projection.local, step_x, step_y);
        sum += weight * background(k, projection.texture, level);
        sum_of_weights += weight;
    }
    if sum_of_weights > 0.0 {
        return vec4<f32>(sum / sum_of_weights, 1.0);
    }

    var best = 0.0;
    var color = in.material;
    for (var k = 0u; k < view.n_surface_cameras; k++) {
        let cosine = dot(normalize(cameras[k].position_from_eye - point), normal);
        if !(cosine > best) {
            continue;
        }
        let projection = project(k, point);
        let inset = min(projection.texture, 1.0 - projection.texture);
        if !projection.is_seen || !(min(inset.x, inset.y) >= 0.0) || !is_visible(k, projection.local, cosine) {
            continue;
        }
        best = cosine;
        color = background(k, projection.texture, level_of_detail(k, projection.local, step_x, step_y));
    }
    return vec4<f32>(color, 1.0);
}
