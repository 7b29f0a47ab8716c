// Hulls by trimmed cones: every face of every silhouette's cone, where all other silhouettes hold it (Li, Magnor and Seidel 2003,
// Hardware-Accelerated Visual Hull Reconstruction and Rendering).
#import "common/hull_faces.wgsl"

@vertex
fn vs_main(@builtin(vertex_index) corner: u32, face: HullFace) -> FaceVarying {
    return face_vertex(corner, face);
}

@fragment
fn fs_main(in: FaceVarying) -> @location(0) vec4<u32> {
    if !is_within_hull_bounds(in.face.x, in.place) {
        discard;
    }
    let ray = hull_ray(in.position.xy);
    let normal = face_normal(in.face);
    // Where a ray comes in; where it leaves is no surface to the eye.
    if dot(normal, ray.direction) >= 0.0 {
        discard;
    }
    if !is_held(in.face, in.place) {
        discard;
    }
    let t = dot(in.place - ray.origin, view.forward);
    return packed_surface(HullSurface(t, normal, in.face.x, 0.0, 1.0, edge_of(in.face)));
}
