// What a camera could see at most: near plane over distance along the face's axis (reversed depth), 0 for nothing.
#import "common/fullscreen.wgsl"

struct Face {
    // From points relative to the camera, in world axes.
    clip_from_camera: mat4x4<f32>,
}

@group(1) @binding(0) var<storage, read> faces: array<Face>;
@group(2) @binding(0) var depth: texture_depth_2d;

// The instance is the face.
@vertex
fn vs_main(
    @location(0) position_from_camera: vec3<f32>,
    @builtin(instance_index) face_idx: u32,
) -> @builtin(position) vec4<f32> {
    return faces[face_idx].clip_from_camera * vec4<f32>(position_from_camera, 1.0);
}

@vertex
fn vs_dilate(@builtin(vertex_index) vertex_idx: u32) -> @builtin(position) vec4<f32> {
    return fullscreen_position(vertex_idx);
}

fn depth_at(texel: vec2<i32>) -> f32 {
    let last = vec2<i32>(textureDimensions(depth)) - 1;
    return textureLoad(depth, clamp(texel, vec2<i32>(0), last), 0);
}

fn smaller_step(back: f32, forth: f32) -> f32 {
    return select(forth, back, abs(back) < abs(forth));
}

// How much nearer than the plane through the texel, relative, begins another surface.
const DISCONTINUITY: f32 = 0.02;

// The depth with discontinuities dilated towards the farther side: g by 4 texels (Montage4D section 4.2); r by 3,
// about a pixel of a small picture, so that filtering cannot mix what hides into what is hidden. The inverse of
// distance is affine over a plane's picture, so a plane is recognised at any slope. Eight directions find every
// straight edge to 0.3 texels.
@fragment
fn fs_dilate(@builtin(position) position: vec4<f32>) -> @location(0) vec2<f32> {
    let texel = vec2<i32>(position.xy);
    let here = depth_at(texel);
    let x = vec2<i32>(1, 0);
    let y = vec2<i32>(0, 1);
    let slope = vec2<f32>(
        smaller_step(here - depth_at(texel - x), depth_at(texel + x) - here),
        smaller_step(here - depth_at(texel - y), depth_at(texel + y) - here),
    );
    var nearest = vec2<f32>(here);
    for (var i = 0; i < 24; i++) {
        let angle = f32(i % 8) * 0.7853981633974483;
        let radius = array<f32, 3>(1.5, 3.0, 4.0)[i / 8];
        let offset = vec2<i32>(round(vec2<f32>(cos(angle), sin(angle)) * radius));
        let there = depth_at(texel + offset);
        let expected = here + dot(slope, vec2<f32>(offset));
        if there - expected > DISCONTINUITY * here {
            nearest = max(nearest, vec2<f32>(select(there, 0.0, radius > 3.0), there));
        }
    }
    return nearest;
}
