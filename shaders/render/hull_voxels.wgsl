// Hulls by the outermost voxels, each a square that faces the eye (microfacets; Goldluecke and Magnor 2003, Real-time microfacet
// billboarding for free-viewpoint video rendering).
#import "common/hull.wgsl"

struct VoxelIn {
    // Middle, from the anchor, and side in metres.
    @location(0) voxel: vec4<f32>,
    // Which hull; two numbers of an octahedral normal.
    @location(1) more: vec2<u32>,
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) @interpolate(flat) more: vec2<u32>,
}

const LOOKS_AWAY: f32 = 0.5;
const SQRT_3: f32 = 1.7320508;

@vertex
fn vs_main(@builtin(vertex_index) corner: u32, in: VoxelIn) -> Varying {
    let middle = in.voxel.xyz;
    let to_eye = view.eye_from_anchor - middle;
    let distance = max(length(to_eye), 1e-6);
    // A square that faces the eye covers the voxel's ball, whose picture is larger the nearer it is.
    let share = SQRT_3 * in.voxel.w / distance;
    let grown = inverseSqrt(max(1.0 - 0.25 * share * share, 0.05));
    let side = SQRT_3 * in.voxel.w * select(grown, 1.0, view.is_parallel != 0u);
    let towards = to_viewer_from(middle);
    let is_steep = abs(dot(towards, view.down)) > 0.9;
    let across = normalize(cross(select(view.down, view.right, is_steep), towards));
    let along = cross(towards, across);
    let x = select(-0.5, 0.5, (corner & 1u) != 0u);
    let y = select(-0.5, 0.5, (corner & 2u) != 0u);
    let place = middle + (across * x + along * y) * side;
    return Varying(view.clip_from_anchor * vec4<f32>(place, 1.0), place, in.more);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<u32> {
    let ray = hull_ray(in.position.xy);
    let t = dot(in.place - ray.origin, view.forward);
    let normal = from_octahedral(unpack2x16snorm(in.more.y));
    // The far side, which an eye within would see; normals of voxels are not good enough to tell it at its edge.
    if dot(normal, ray.direction) > LOOKS_AWAY * length(ray.direction) {
        discard;
    }
    return packed_surface(HullSurface(t, normal, in.more.x, 0.0, 1.0, NO_EDGE));
}
