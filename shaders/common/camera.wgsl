// The one camera model on the GPU: src/vision/geometry/camera.rs is its counterpart and specification.

const MODEL_PINHOLE: u32 = 0u;
const MODEL_BROWN_CONRADY: u32 = 1u;
const MODEL_FISHEYE: u32 = 2u;

// Distance along the axis below which a point has no texture coordinate, metres: geometry::NEAR_M.
const CAMERA_NEAR_M: f32 = 0.01;

// Most cameras of one frame: MAX_CAMERAS of src/render/camera_data.rs.
const MAX_CAMERAS: u32 = 212u;
// Whether any camera has a lens that bends: a variant without leaves the models out. Rasterisers on a processor run
// both sides of every branch.
override HAS_LENSES: bool = true;
// Whether any camera's gain is not 1.
override HAS_GAINS: bool = true;

// Directions around the axis in which the lens's limit is tabulated.
const N_LIMIT_DIRECTIONS: u32 = 64u;
const TAU: f32 = 6.283185307179586;

struct Camera {
    // Rows of the rigid transform to camera axes (x right, y down, z forward) from points relative to the anchor.
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    position_from_anchor: vec3<f32>,
    model: u32,
    // Focal lengths and principal point in units of the picture's size.
    focal: vec2<f32>,
    center: vec2<f32>,
    // Brown-Conrady: k1 k2 p1 p2; fisheye: k1 k2 k3 k4.
    coefficients_low: vec4<f32>,
    // Brown-Conrady: k3 k4 k5 k6.
    coefficients_high: vec4<f32>,
    // The share of their layers that the background and the live frame cover.
    background_scale: vec2<f32>,
    frame_scale: vec2<f32>,
    background_size_px: vec2<f32>,
    frame_size_px: vec2<f32>,
    background_layer: u32,
    frame_layer: u32,
    // First of N_LIMIT_DIRECTIONS entries of `limits`.
    limit_offset: u32,
    // 0 without a depth map, 1 for one pinhole map, 6 for a cube.
    n_depth_faces: u32,
    // Middle and half extent of the single depth map, tangents of angles off the axis.
    depth_bounds: vec4<f32>,
    // Layers of faces 0 to 3, then of 4 and 5.
    depth_layers_low: vec4<u32>,
    depth_layers_high: vec4<u32>,
    // What the camera's colours are multiplied by in linear light.
    gain: vec3<f32>,
    pad_gain: u32,
}

@group(0) @binding(1) var<uniform> cameras: array<Camera, MAX_CAMERAS>;
@group(0) @binding(2) var<storage, read> limits: array<f32>;

struct Projection {
    // Texture coordinate; outside [0, 1]^2 the point is beside the picture. Means nothing unless `is_seen`.
    texture: vec2<f32>,
    // False where there is no texture coordinate at all.
    is_seen: bool,
    // The point in camera axes, metres.
    local: vec3<f32>,
}

// The smaller of the two neighbouring entries: never beyond the true limit between them.
fn lens_limit(camera_idx: u32, direction: vec2<f32>) -> f32 {
    let turn = atan2(direction.y, direction.x) / TAU + 1.0;
    let place = turn * f32(N_LIMIT_DIRECTIONS);
    let first = u32(place) % N_LIMIT_DIRECTIONS;
    let offset = cameras[camera_idx].limit_offset;
    return min(limits[offset + first], limits[offset + (first + 1u) % N_LIMIT_DIRECTIONS]);
}

fn distort_brown_conrady(camera_idx: u32, p: vec2<f32>) -> vec2<f32> {
    let low = cameras[camera_idx].coefficients_low;
    let high = cameras[camera_idx].coefficients_high;
    let r2 = dot(p, p);
    let numerator = 1.0 + r2 * (low.x + r2 * (low.y + r2 * high.x));
    let denominator = 1.0 + r2 * (high.y + r2 * (high.z + r2 * high.w));
    let tangential = vec2<f32>(
        2.0 * low.z * p.x * p.y + low.w * (r2 + 2.0 * p.x * p.x),
        low.z * (r2 + 2.0 * p.y * p.y) + 2.0 * low.w * p.x * p.y,
    );
    return p * (numerator / denominator) + tangential;
}

fn distort_fisheye(camera_idx: u32, local: vec3<f32>, theta: f32) -> vec2<f32> {
    let k = cameras[camera_idx].coefficients_low;
    let t2 = theta * theta;
    let bent = theta * (1.0 + t2 * (k.x + t2 * (k.y + t2 * (k.z + t2 * k.w))));
    let radius = length(local.xy);
    // On the axis the direction is free and theta over the radius tends to 1 / z.
    let factor = select(bent / max(radius, 1e-20), 1.0 / local.z, radius < 1e-6 * abs(local.z));
    return local.xy * factor;
}

// u = (fx x' + cx) / width, with nothing behind the near plane or beyond the lens's limit. Free of divergent
// branches, so that neighbouring pixels' results may be subtracted.
fn project(camera_idx: u32, point_from_anchor: vec3<f32>) -> Projection {
    let point = vec4<f32>(point_from_anchor, 1.0);
    let local = vec3<f32>(
        dot(cameras[camera_idx].row_x, point),
        dot(cameras[camera_idx].row_y, point),
        dot(cameras[camera_idx].row_z, point),
    );
    var is_seen = local.z > CAMERA_NEAR_M;
    let pinhole = local.xy / select(1.0, local.z, is_seen);
    var distorted = pinhole;
    if HAS_LENSES {
        let model = cameras[camera_idx].model;
        if model == MODEL_BROWN_CONRADY {
            is_seen = is_seen && length(pinhole) < lens_limit(camera_idx, pinhole);
            distorted = distort_brown_conrady(camera_idx, pinhole);
        } else if model == MODEL_FISHEYE {
            let theta = atan2(length(local.xy), local.z);
            is_seen = length(local) > CAMERA_NEAR_M && theta < lens_limit(camera_idx, local.xy);
            distorted = distort_fisheye(camera_idx, local, theta);
        }
    }
    let texture = cameras[camera_idx].focal * distorted + cameras[camera_idx].center;
    return Projection(texture, is_seen, local);
}

// A colour of the camera's, in linear light, as it agrees with other cameras'; what is brighter than white is white.
fn evened(camera_idx: u32, color: vec3<f32>) -> vec3<f32> {
    if HAS_GAINS {
        return min(color * cameras[camera_idx].gain, vec3<f32>(1.0));
    }
    return color;
}
