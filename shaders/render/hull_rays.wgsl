// Hulls by the rays of the picture's pixels, each cut by every outline along its epipolar line: no geometry, exact to the texel.
#import "common/hull.wgsl"

@group(1) @binding(0) var surface: texture_storage_2d<rgba32uint, write>;

@compute @workgroup_size(8, 8)
fn cs_main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface);
    if any(id.xy >= size) {
        return;
    }
    let pixel = vec2<f32>(id.xy) + 0.5;
    let ray = hull_ray(pixel);
    var texel = vec4<u32>(0u);
    var nearest = FAR;
    for (var hull_idx = 0u; hull_idx < hull_frame.n_hulls; hull_idx++) {
        let rect = hulls[hull_idx].rect_px;
        if any(pixel < rect.xy) || any(pixel > rect.zw) {
            continue;
        }
        var range = within_bounds(hull_idx, ray);
        let is_eye_within = range.x < VIEW_NEAR_M;
        range = vec2<f32>(max(range.x, VIEW_NEAR_M), min(range.y, nearest));
        if range.x >= range.y {
            continue;
        }
        // From the bounds on, so that an eye far away costs no digits.
        let near = HullRay(ray.origin + ray.direction * range.x, ray.direction);
        let length = range.y - range.x;
        var hit = hull_hit(hull_idx, near, vec2<f32>(0.0, length), NO_VIEW);
        // An eye in the hull sees what lies behind it.
        if hit.is_hit && hit.t == 0.0 && is_eye_within {
            hit = hull_hit(hull_idx, near, vec2<f32>(hit.exit + 1e-4, length), NO_VIEW);
        }
        if hit.is_hit {
            nearest = range.x + hit.t;
            texel = packed_surface(HullSurface(nearest, hit.normal, hull_idx, hit.exit - hit.t, 1.0, hit.edge));
        }
    }
    textureStore(surface, id.xy, texel);
}
