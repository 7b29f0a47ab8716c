// How far what a picture shows lies, pixel by pixel, and the places and normals that follow from it, in the view's axes: x right,
// y down, z forward. src/vision/effects/distances.rs is its counterpart and specification.

struct Lens {
    // Left and top edge of the picture: tangents off the axis, of parallel rays metres.
    first: vec2<f32>,
    // Extent of a pixel, as `first`.
    pitch: vec2<f32>,
    // Metres before the eye from which distances are counted.
    start_m: f32,
    is_parallel: u32,
    // From reversed depth d: metres beyond the start are scale (1 - d), over d + falling where rays meet in the eye.
    scale: f32,
    falling: f32,
    // What the upper left pixel is called in all of the picture.
    anchor: vec2<i32>,
    pad: vec2<u32>,
}

@group(0) @binding(0) var<uniform> lens: Lens;
// Metres beyond the start; below 0 where nothing stands.
@group(0) @binding(1) var distances: texture_2d<f32>;

const NOTHING_M: f32 = -1.0;

fn distance_at(pixel: vec2<i32>) -> f32 {
    let size = vec2<i32>(textureDimensions(distances));
    if any(pixel < vec2<i32>(0)) || any(pixel >= size) {
        return NOTHING_M;
    }
    return textureLoad(distances, pixel, 0).r;
}

// What one metre across is of the picture's extents.
fn depth_of(beyond_m: f32) -> f32 {
    return select(lens.start_m + beyond_m, 1.0, lens.is_parallel != 0u);
}

fn on_plane(pixel: vec2<i32>) -> vec2<f32> {
    return lens.first + lens.pitch * (vec2<f32>(pixel) + 0.5);
}

fn place_of(pixel: vec2<i32>, beyond_m: f32) -> vec3<f32> {
    return vec3<f32>(on_plane(pixel) * depth_of(beyond_m), beyond_m);
}

// Of any length.
fn to_viewer_from_pixel(pixel: vec2<i32>) -> vec3<f32> {
    let through_eye = -vec3<f32>(on_plane(pixel), 1.0);
    return select(through_eye, vec3<f32>(0.0, 0.0, -1.0), lens.is_parallel != 0u);
}

// From a pixel's place to that of the next along an axis, on the same surface as far as can be told.
fn step_along(pixel: vec2<i32>, axis: vec2<i32>) -> vec3<f32> {
    let ahead = pixel + axis;
    let behind = pixel - axis;
    let here = distance_at(pixel);
    let next = distance_at(ahead);
    let last = distance_at(behind);
    let place = place_of(pixel, here);
    if next < 0.0 && last < 0.0 {
        return place_of(ahead, here) - place;
    }
    if last < 0.0 || (next >= 0.0 && abs(next - here) <= abs(last - here)) {
        return place_of(ahead, next) - place;
    }
    return place - place_of(behind, last);
}

// Unit, towards the viewer.
fn normal_of(pixel: vec2<i32>) -> vec3<f32> {
    let across = step_along(pixel, vec2<i32>(1, 0));
    let down = step_along(pixel, vec2<i32>(0, 1));
    let normal = cross(down, across);
    let to_viewer = normalize(to_viewer_from_pixel(pixel));
    let norm = length(normal);
    if norm <= 1e-30 {
        return to_viewer;
    }
    let unit = normal / norm;
    return select(unit, -unit, dot(unit, to_viewer) < 0.0);
}
