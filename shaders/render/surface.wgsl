// Ground and boxes with the cameras' backgrounds projected on them.
//
// Per fragment, for camera k: W_k = V W_f W_s W_d; colour = sum W_k T_k / sum W_k, after "Hybrid" (2004) sections
// 4.3 and 4.4, W_s = max(d_k . n, 0)^5, W_d = (d_k . d_v + 1)^5. Where every weight vanishes: the camera that sees
// the surface most squarely, then the material.
#import "common/view.wgsl"
#import "common/camera.wgsl"

@group(1) @binding(0) var backgrounds: texture_2d_array<f32>;
@group(1) @binding(1) var background_sampler: sampler;
// rg: the depths of camera_depth.wgsl, discontinuities dilated a little and further.
@group(1) @binding(2) var depth_maps: texture_2d_array<f32>;
@group(1) @binding(3) var depth_sampler: sampler;
// The picture on what is drawn, for what has one.
@group(2) @binding(0) var picture: texture_2d<f32>;
@group(2) @binding(1) var picture_sampler: sampler;

// The cameras of a batch of patches, by their places in `cameras`.
struct CameraList {
    low: vec4<u32>,
    high: vec4<u32>,
}

@group(1) @binding(4) var<uniform> list: CameraList;

// How many the list has. A constant saves rasterisers on a processor one more round of the loop.
override N_LISTED: u32 = 0u;
// Whether any camera has a depth map, and whether any map is a cube: variants without leave them out.
override HAS_DEPTH_MAPS: bool = true;
override HAS_DEPTH_CUBES: bool = true;
// Whether backgrounds are looked up in levels of detail.
override HAS_LEVELS: bool = true;

// Distance from the border at which a picture counts in full, share of its size.
const FEATHER: f32 = 0.06;
// A share of visibility and feather below this counts as none, so that the sum of weights cannot underflow.
const LEAST_SHARE: f32 = 1e-6;
// Alpha of what a camera may show: whatever is mixed with something hidden has less.
const IN_SIGHT: f32 = 0.999;
// Sine of half a degree: what a camera sees at less than that is smeared beyond use, and often not the surface.
const LEAST_COSINE: f32 = 0.0087265;
// Places at which a picture is looked up for a pixel.
const N_TAPS: u32 = 4u;
// Near plane of the depth maps, metres: passes/camera_depth.rs.
const DEPTH_NEAR_M: f32 = 0.05;
// How far off its plane a place is taken to be by interpolation alone, share of its distance.
const MOST_OFF_PLANE: f32 = 0.01;
// How much nearer, relative, what hides must be.
const DEPTH_BIAS: f32 = 1e-3;

struct VertexIn {
    @location(0) position_from_anchor: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // w: by which share of its depth it is nearer than it is, where several surfaces share a plane.
    @location(2) material: vec4<f32>,
}

struct Varying {
    // The same to the last bit in all variants, so that what was found nearest is drawn.
    @builtin(position) @invariant position: vec4<f32>,
    // At the covered part of the pixel, so that nothing beyond the surface's edge is projected.
    @location(0) @interpolate(perspective, centroid) position_from_anchor: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) @interpolate(flat) material: vec3<f32>,
    // normal . p of the triangle's plane.
    @location(5) @interpolate(flat) height: f32,
}

@vertex
fn vs_main(in: VertexIn) -> Varying {
    return Varying(clip_place(in), in.position_from_anchor, in.normal, in.material.xyz, plane_height(in));
}

// Depth is reversed, so more of it is nearer.
fn clip_place(in: VertexIn) -> vec4<f32> {
    let place = view.clip_from_anchor * vec4<f32>(in.position_from_anchor, 1.0);
    return vec4<f32>(place.xy, place.z * (1.0 + in.material.w), place.w);
}

fn plane_height(in: VertexIn) -> f32 {
    return dot(in.normal, in.position_from_anchor);
}

struct TexturedVarying {
    @builtin(position) @invariant position: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) position_from_anchor: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) @interpolate(flat) material: vec3<f32>,
    // Homogeneous texture coordinate; w: whether the material shows beyond the picture.
    @location(3) @interpolate(perspective, centroid) texture: vec4<f32>,
    @location(4) @interpolate(flat) tint: vec3<f32>,
    @location(5) @interpolate(flat) height: f32,
}

@vertex
fn vs_textured(in: VertexIn, @location(3) texture: vec4<f32>, @location(4) tint: vec3<f32>) -> TexturedVarying {
    let height = plane_height(in);
    return TexturedVarying(
        clip_place(in), in.position_from_anchor, in.normal, in.material.xyz, texture, tint, height);
}

// What the surface looks like where no camera sees it: its picture, as anisotropic filtering shows it
// (EXT_texture_filter_anisotropic). N_TAPS places along the longer side of the pixel in the picture, each filtered so wide
// as the shorter side or what lies between two of them; a square pixel is one place. Free of branches, for derivatives.
fn material_color(in: TexturedVarying) -> vec3<f32> {
    let is_before_horizon = in.texture.z > 1e-6;
    let place = in.texture.xy / select(1.0, in.texture.z, is_before_horizon);
    let size = vec2<f32>(textureDimensions(picture));
    let step_x = dpdx(place);
    let step_y = dpdy(place);
    let length_x = length(step_x * size);
    let length_y = length(step_y * size);
    let longer = max(length_x, length_y);
    let shorter = min(length_x, length_y);
    let level = max(log2(max(max(longer / f32(N_TAPS), shorter), 1e-6)), 0.0);
    let along = select(step_y, step_x, length_x >= length_y) * (1.0 - shorter / max(longer, 1e-12));
    var sum = vec3<f32>(0.0);
    for (var tap = 0u; tap < N_TAPS; tap++) {
        let share = (f32(tap) + 0.5) / f32(N_TAPS) - 0.5;
        sum += textureSampleLevel(picture, picture_sampler, place + along * share, level).rgb;
    }
    let is_within = is_before_horizon && all(place >= vec2<f32>(0.0)) && all(place <= vec2<f32>(1.0));
    return select(in.material, in.tint * sum / f32(N_TAPS), is_within || in.texture.w < 0.5);
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    return x2 * x2 * x;
}

struct DepthPlace {
    // Coordinate in the face, [0, 1]^2 inside.
    texture: vec2<f32>,
    layer: u32,
    distance_m: f32,
    // By how much the depth of the surface's plane grows over the face, relative to the depth here.
    slope: vec2<f32>,
}

// Which face of a cube a point lies before.
fn cube_face(local: vec3<f32>) -> u32 {
    let size = abs(local);
    if size.z >= size.x && size.z >= size.y {
        return select(0u, 1u, local.z < 0.0);
    }
    if size.x >= size.y {
        return select(2u, 3u, local.x < 0.0);
    }
    return select(4u, 5u, local.y < 0.0);
}

// A vector in a face's axes: the rotations of FACE_FROM_CAMERA in passes/camera_depth.rs.
fn on_cube(face: u32, local: vec3<f32>) -> vec3<f32> {
    let along_z = select(local, vec3<f32>(-local.x, local.y, -local.z), face == 1u);
    let along_x = select(
        vec3<f32>(-local.z, local.y, local.x), vec3<f32>(local.z, local.y, -local.x), face == 3u);
    let along_y = select(
        vec3<f32>(local.x, -local.z, local.y), vec3<f32>(local.x, local.z, -local.y), face == 5u);
    return select(select(along_z, along_x, face >= 2u), along_y, face >= 4u);
}

// `normal`: the surface's, in camera axes as the point.
fn depth_place(camera_idx: u32, local: vec3<f32>, normal: vec3<f32>) -> DepthPlace {
    var on_face = local;
    var turned = normal;
    var layer = cameras[camera_idx].depth_layers_low.x;
    if HAS_DEPTH_CUBES && cameras[camera_idx].n_depth_faces == 6u {
        let face = cube_face(local);
        on_face = on_cube(face, local);
        turned = on_cube(face, normal);
        let low = cameras[camera_idx].depth_layers_low[face & 3u];
        let high = cameras[camera_idx].depth_layers_high[face & 3u];
        layer = select(low, high, face >= 4u);
    }
    let bounds = cameras[camera_idx].depth_bounds;
    let tangent = (on_face.xy / on_face.z - bounds.xy) / bounds.zw;
    // On the plane normal . p = h the inverse of depth is normal . (x, y, 1) / h at the tangents x and y.
    let height = dot(turned, on_face);
    let slope = turned.xy * 2.0 * bounds.zw * on_face.z / select(height, -1e-12, height > -1e-12);
    return DepthPlace(tangent * 0.5 + 0.5, layer, on_face.z, slope);
}

fn in_camera(camera_idx: u32, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        dot(cameras[camera_idx].row_x.xyz, direction),
        dot(cameras[camera_idx].row_y.xyz, direction),
        dot(cameras[camera_idx].row_z.xyz, direction),
    );
}

fn bilinear(corners: vec4<f32>, share: vec2<f32>) -> f32 {
    // Gathered: lower left, lower right, upper right, upper left.
    return mix(mix(corners.w, corners.z, share.x), mix(corners.x, corners.y, share.x), share.y);
}

// V: whether nothing stands before the nearest texel (x), and the share of the four nearest that nothing stands
// before with discontinuities dilated further (y). A texel is held to the depth that the surface's plane has in its
// middle: so grazing surfaces need no wider bias, in which what hides them from near would be lost.
fn visibility(camera_idx: u32, local: vec3<f32>, normal: vec3<f32>) -> vec2<f32> {
    let place = depth_place(camera_idx, local, normal);
    let is_beside = any(place.texture < vec2<f32>(0.0)) || any(place.texture > vec2<f32>(1.0));
    if cameras[camera_idx].n_depth_faces == 0u || is_beside || place.distance_m <= DEPTH_NEAR_M {
        return vec2<f32>(1.0);
    }
    let size = vec2<f32>(textureDimensions(depth_maps));
    let at = place.texture * size - 0.5;
    // From here to the middles of the lower left, lower right, upper right, upper left and nearest texel.
    let low = (floor(at) - at) / size;
    let high = low + 1.0 / size;
    let nearest = (floor(at + 0.5) - at) / size;
    let own = DEPTH_NEAR_M / place.distance_m;
    let over_x = vec4<f32>(low.x, high.x, high.x, low.x) * place.slope.x;
    let over_y = vec4<f32>(high.y, high.y, low.y, low.y) * place.slope.y;
    let limits = own * (1.0 + DEPTH_BIAS + over_x + over_y);
    let limit = own * (1.0 + DEPTH_BIAS + dot(nearest, place.slope));
    let depth = textureSampleLevel(depth_maps, depth_sampler, place.texture, place.layer, 0.0).r;
    let dilated = textureGather(1, depth_maps, depth_sampler, place.texture, place.layer);
    return vec2<f32>(step(depth, limit), bilinear(step(dilated, limits), fract(at)));
}

// The geometric mean of a pixel's sides in the camera's picture: between blurring its short side and aliasing along
// its long one.
fn level_of_detail(camera_idx: u32, step_x: vec2<f32>, step_y: vec2<f32>) -> f32 {
    let size = cameras[camera_idx].background_size_px;
    let x = step_x * size;
    let y = step_y * size;
    return max(0.25 * log2(max(dot(x, x) * dot(y, y), 1e-12)), 0.0);
}

// The colour of a fragment; `material` where no camera looks.
fn shaded(in: Varying, material: vec3<f32>) -> vec4<f32> {
    var point = in.position_from_anchor;
    if HAS_DEPTH_MAPS {
        // Where a triangle covers a part of the pixel, some devices interpolate a place a little before or behind its plane,
        // from which a camera that looks along it would see it hidden.
        let off = in.height - dot(in.normal, point);
        let most = MOST_OFF_PLANE * length(point);
        point += in.normal * clamp(off, -most, most);
    }
    let to_viewer = to_viewer_from(point);
    let normal = select(-in.normal, in.normal, dot(in.normal, to_viewer) >= 0.0);

    // Weights are fifth powers of s_k = (d_k . n) (d_k . d_v + 1). They are summed relative to the greatest s met so
    // far, and the sums rescaled when a greater one comes: no underflow, whatever the angles.
    var sum = vec3<f32>(0.0);
    var sum_of_weights = 0.0;
    var greatest = 0.0;
    // What shows where every weight vanishes.
    var squarest = 0.0;
    var fallback = material;
    for (var idx = 0u; idx < N_LISTED; idx++) {
        let k = select(list.low[idx & 3u], list.high[idx & 3u], idx >= 4u);
        let projection = project(k, point);
        var level = 0.0;
        if HAS_LEVELS {
            level = level_of_detail(k, dpdx(projection.texture), dpdy(projection.texture));
        }
        let to_camera = normalize(cameras[k].position_from_anchor - point);
        let cosine = dot(to_camera, normal);
        let inset = min(projection.texture, 1.0 - projection.texture);
        let border = min(inset.x, inset.y);
        if !(projection.is_seen && border >= 0.0 && cosine > LEAST_COSINE) {
            continue;
        }
        var open = vec2<f32>(1.0);
        if HAS_DEPTH_MAPS {
            open = visibility(k, projection.local, in_camera(k, normal));
        }
        let place = projection.texture * cameras[k].background_scale;
        let layer = cameras[k].background_layer;
        let looked_up = textureSampleLevel(backgrounds, background_sampler, place, layer, level);
        // What is hidden of its picture the camera does not see: others may.
        if looked_up.a < IN_SIGHT {
            continue;
        }
        let color = evened(k, looked_up.rgb);
        if open.x >= 0.5 && cosine > squarest {
            squarest = cosine;
            fallback = color;
        }
        // d_k . d_v + 1, without the cancellation where camera and viewer face each other.
        let between = to_camera + to_viewer;
        let s = cosine * 0.5 * dot(between, between);
        let share = smoothstep(0.0, FEATHER, border) * open.y;
        if !(share > LEAST_SHARE) {
            continue;
        }
        let smaller = fifth_power(min(s, greatest) / max(s, greatest));
        let is_greatest = s > greatest;
        let keep = select(1.0, smaller, is_greatest);
        let weight = share * select(smaller, 1.0, is_greatest);
        sum = sum * keep + weight * color;
        sum_of_weights = sum_of_weights * keep + weight;
        greatest = max(greatest, s);
    }
    return vec4<f32>(select(fallback, sum / max(sum_of_weights, 1e-30), sum_of_weights > 0.0), 1.0);
}

// Of what cameras lend to a place of a triangle, from which share on it is seen there.
const LEAST_LENT: f32 = 0.75;

struct FieldsVarying {
    @builtin(position) @invariant position: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) position_from_anchor: vec3<f32>,
    @location(2) @interpolate(flat) material: vec3<f32>,
    // What each camera of the list lends.
    @location(6) @interpolate(perspective, centroid) lent_low: vec4<f32>,
    @location(7) @interpolate(perspective, centroid) lent_high: vec4<f32>,
}

@vertex
fn vs_fields(in: VertexIn, @location(6) lent_low: vec4<f32>, @location(7) lent_high: vec4<f32>) -> FieldsVarying {
    return FieldsVarying(clip_place(in), in.position_from_anchor, in.material.xyz, lent_low, lent_high);
}

struct TexturedFieldsVarying {
    @builtin(position) @invariant position: vec4<f32>,
    @location(0) @interpolate(perspective, centroid) position_from_anchor: vec3<f32>,
    @location(2) @interpolate(flat) material: vec3<f32>,
    @location(3) @interpolate(perspective, centroid) texture: vec4<f32>,
    @location(4) @interpolate(flat) tint: vec3<f32>,
    @location(6) @interpolate(perspective, centroid) lent_low: vec4<f32>,
    @location(7) @interpolate(perspective, centroid) lent_high: vec4<f32>,
}

@vertex
fn vs_fields_textured(
    in: VertexIn,
    @location(3) texture: vec4<f32>,
    @location(4) tint: vec3<f32>,
    @location(6) lent_low: vec4<f32>,
    @location(7) lent_high: vec4<f32>,
) -> TexturedFieldsVarying {
    return TexturedFieldsVarying(
        clip_place(in), in.position_from_anchor, in.material.xyz, texture, tint, lent_low, lent_high);
}

// The colour of a fragment by what its triangle's vertices are lent (fields.wgsl); `material` where nobody lends anything, and more
// and more of it towards vertices to which nobody does: somewhere before these what hides them begins in the cameras' pictures.
fn mixed(point: vec3<f32>, lent_low: vec4<f32>, lent_high: vec4<f32>, material: vec3<f32>) -> vec4<f32> {
    var sum = vec3<f32>(0.0);
    var sum_of_weights = 0.0;
    let lent = dot(lent_low, vec4<f32>(1.0)) + dot(lent_high, vec4<f32>(1.0));
    for (var idx = 0u; idx < N_LISTED; idx++) {
        let listed = select(list.low[idx & 3u], list.high[idx & 3u], idx >= 4u);
        let k = min(listed, MAX_CAMERAS - 1u);
        let weight = select(lent_low[idx & 3u], lent_high[idx & 3u], idx >= 4u);
        let projection = project(k, point);
        var level = 0.0;
        if HAS_LEVELS {
            level = level_of_detail(k, dpdx(projection.texture), dpdy(projection.texture));
        }
        let inset = min(projection.texture, 1.0 - projection.texture);
        let is_drawn = (listed < MAX_CAMERAS) & (weight > LEAST_SHARE);
        if !(is_drawn && projection.is_seen && min(inset.x, inset.y) >= 0.0) {
            continue;
        }
        let place = projection.texture * cameras[k].background_scale;
        let looked_up = textureSampleLevel(backgrounds, background_sampler, place, cameras[k].background_layer, level);
        // What is hidden of its picture the camera does not see: others may.
        if looked_up.a < IN_SIGHT {
            continue;
        }
        sum += weight * evened(k, looked_up.rgb);
        sum_of_weights += weight;
    }
    let seen = mix(material, sum / max(sum_of_weights, 1e-30), smoothstep(LEAST_LENT, 1.0, lent));
    return vec4<f32>(select(material, seen, sum_of_weights > 0.0), 1.0);
}

@fragment
fn fs_fields(in: FieldsVarying) -> @location(0) vec4<f32> {
    return mixed(in.position_from_anchor, in.lent_low, in.lent_high, in.material);
}

// Of what has a picture.
@fragment
fn fs_fields_textured(in: TexturedFieldsVarying) -> @location(0) vec4<f32> {
    let plain = TexturedVarying(
        in.position, in.position_from_anchor, vec3<f32>(0.0), in.material, in.texture, in.tint, 0.0);
    return mixed(in.position_from_anchor, in.lent_low, in.lent_high, material_color(plain));
}

@fragment
fn fs_depth() -> @location(0) vec4<f32> {
    return vec4<f32>(0.0);
}

// Of what no camera sees: needs nothing of any.
@fragment
fn fs_bare(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(in.material, 1.0);
}

@fragment
fn fs_bare_textured(in: TexturedVarying) -> @location(0) vec4<f32> {
    return vec4<f32>(material_color(in), 1.0);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4<f32> {
    return shaded(in, in.material);
}

// Of what has a picture.
@fragment
fn fs_textured(in: TexturedVarying) -> @location(0) vec4<f32> {
    let plain = Varying(in.position, in.position_from_anchor, in.normal, in.material, in.height);
    return shaded(plain, material_color(in));
}
