//! What `shaders/render/surface.wgsl` must draw, in f64 and by rays: the same weights, fall-back order and sampling,
//! with visibility known exactly.
//!
//! Pixels where an exact answer and a depth map of finite size may differ (within some texels of a silhouette as a
//! camera sees it) are told apart, so that the rest can be held to a narrow tolerance.

use super::twin_paint::{Painter, linear};
use glam::{DVec2, DVec3};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{Plan, View};
use videofields_vision::frame::{RgbImage, YuvImage, linear_from_srgb, srgb_from_linear};
use videofields_vision::geometry::{Camera, Face, Hit, Shape, SurfaceId, Surfaces};

const FEATHER: f64 = 0.06;
const LEAST_COSINE: f64 = 0.008_726_5;
const N_LEVELS: usize = 5;
/// Texels of a depth map (1024 each way) around a silhouette within which it may be wrong, share of the picture.
const SILHOUETTE: f64 = 7.0 / 1024.0;

/// A twin's picture.
pub(crate) struct Twin {
    pub image: RgbImage,
    /// Whether the pixel has one right answer.
    pub is_clear: Vec<bool>,
}

pub(crate) fn render(state: &SceneState, view: &View, plan: &Plan) -> Twin {
    let pyramids: Vec<Pyramid> = plan
        .surface_cameras
        .iter()
        .map(|idx| Pyramid::new(&state.cameras[*idx].observation.background))
        .collect();
    let gain = |idx: usize| if plan.evens_colors { state.cameras[idx].gain.as_dvec3() } else { DVec3::ONE };
    let cameras: Vec<(&Camera, &Pyramid, DVec3)> = plan
        .surface_cameras
        .iter()
        .zip(&pyramids)
        .map(|(idx, pyramid)| (&*state.cameras[*idx].camera, pyramid, gain(*idx)))
        .collect();
    let painter = Painter::new(state);
    let (mut data, mut is_clear) = (Vec::new(), Vec::new());
    for y in 0..view.height_px {
        for x in 0..view.width_px {
            let pixel = Pixel::new(state, view, f64::from(x) + 0.5, f64::from(y) + 0.5);
            let (color, clear) = pixel.shade(state, &cameras, &painter);
            data.extend(color);
            is_clear.push(clear);
        }
    }
    Twin { image: RgbImage { width: view.width_px, height: view.height_px, data }, is_clear }
}

struct Pixel {
    /// Towards the viewer.
    to_viewer: DVec3,
    hit: Option<Hit>,
    /// Steps along the surface to the other pixel of its pair, across and down: devices take differences in quads.
    steps: [DVec3; 2],
    /// Steps from its ray's direction to theirs.
    turns: [DVec3; 2],
    is_interior: bool,
}

pub(crate) fn surface_of(hit: Option<&Hit>) -> Option<(SurfaceId, Face, [i64; 3])> {
    let turned = |normal: DVec3| (normal * 1e3).round().to_array().map(|n| n as i64);
    let direction = |hit: &Hit| match hit.surface {
        // Round, and one surface all the same.
        SurfaceId::Cylinder(_) => [0; 3],
        _ => turned(hit.normal_in_world),
    };
    hit.map(|hit| (hit.surface, hit.face, direction(hit)))
}

impl Pixel {
    fn new(state: &SceneState, view: &View, x: f64, y: f64) -> Self {
        let surfaces = &state.scene.surfaces;
        let ray = |dx: f64, dy: f64| {
            let (width, height) = (f64::from(view.width_px), f64::from(view.height_px));
            view.ray((x + dx) / width, (y + dy) / height)
        };
        let hit = surfaces.hit(&ray(0.0, 0.0), 0.0);
        let same = |dx, dy| surface_of(surfaces.hit(&ray(dx, dy), 0.0).as_ref()) == surface_of(hit.as_ref());
        // Where a quad reaches beyond the horizon, its differences mean nothing.
        let partner = |along: f64| if (along as u32).is_multiple_of(2) { 1.0 } else { -1.0 };
        let meets_plane = |dx, dy| {
            hit.is_none_or(|hit| {
                ray(dx, dy).distance_to_plane(hit.point_in_world, hit.normal_in_world).is_some()
            })
        };
        let has_differences = meets_plane(partner(x), 0.0) && meets_plane(0.0, partner(y));
        let is_interior =
            has_differences && same(0.2, 0.2) && same(-0.2, 0.2) && same(0.2, -0.2) && same(-0.2, -0.2);
        let step = |dx, dy| {
            hit.map_or(DVec3::ZERO, |hit| {
                let ray = ray(dx, dy);
                let further = ray.distance_to_plane(hit.point_in_world, hit.normal_in_world);
                further.map_or(DVec3::ZERO, |distance| ray.at(distance) - hit.point_in_world)
            })
        };
        let forward = ray(0.0, 0.0).direction;
        let turns = [ray(partner(x), 0.0), ray(0.0, partner(y))].map(|ray| ray.direction - forward);
        let steps = [step(partner(x), 0.0), step(0.0, partner(y))];
        Self { to_viewer: -forward, hit, steps, turns, is_interior }
    }

    fn shade(
        &self,
        state: &SceneState,
        cameras: &[(&Camera, &Pyramid, DVec3)],
        painter: &Painter,
    ) -> ([u8; 3], bool) {
        let Some(hit) = &self.hit else {
            let sky = painter.sky(&state.scene.sky, -self.to_viewer, &self.turns);
            return (codes(sky), self.is_interior);
        };
        let point = hit.point_in_world;
        let to_viewer = self.to_viewer;
        let normal = hit.normal_in_world * hit.normal_in_world.dot(to_viewer).signum();
        let (mut sum, mut sum_of_weights) = (DVec3::ZERO, 0.0);
        let mut best: Option<(f64, DVec3)> = None;
        let mut is_clear = self.is_interior;
        for (camera, pyramid, gain) in cameras {
            let to_camera = (camera.pose().position_in_world - point).normalize();
            let cosine = to_camera.dot(normal);
            let Some(projection) = camera.project(point) else { continue };
            let texture = projection.texture;
            let inset = texture.min(1.0 - texture).min_element();
            is_clear &= inset.abs() > 2e-3 || cosine <= LEAST_COSINE;
            is_clear &= (cosine - LEAST_COSINE).abs() > 1e-5;
            is_clear &= self.steps.iter().all(|step| camera.project(point + *step).is_some());
            if cosine <= LEAST_COSINE || inset < 0.0 {
                continue;
            }
            let (is_visible, is_far_from_silhouettes) =
                visibility(&state.scene.surfaces, camera, texture, hit);
            is_clear &= is_far_from_silhouettes;
            if !is_visible {
                continue;
            }
            let color = pyramid.sample(texture, self.level_of_detail(camera, pyramid, point, texture));
            let color = (color * *gain).min(DVec3::ONE);
            if best.is_none_or(|(most, _)| cosine > most) {
                best = Some((cosine, color));
            }
            let t = (inset / FEATHER).min(1.0);
            let weight = t * t * (3.0 - 2.0 * t) * cosine.powi(5) * (to_camera.dot(to_viewer) + 1.0).powi(5);
            sum += color * weight;
            sum_of_weights += weight;
        }
        let color = match best {
            _ if sum_of_weights > 0.0 => sum / sum_of_weights,
            Some((_, color)) => color,
            None => {
                let (picture, has_one_answer) = painter.at(state, hit, &self.steps);
                is_clear &= has_one_answer;
                material(state, hit, picture)
            }
        };
        (codes(color), is_clear)
    }

    fn level_of_detail(&self, camera: &Camera, pyramid: &Pyramid, point: DVec3, texture: DVec2) -> f64 {
        let crossed = |step: DVec3| {
            let moved = camera.project(point + step).map_or(texture, |projection| projection.texture);
            ((moved - texture) * pyramid.size).length()
        };
        (0.5 * (crossed(self.steps[0]) * crossed(self.steps[1])).max(1e-12).log2()).max(0.0)
    }
}

/// Whether the camera sees the surface there, and whether a map could not think otherwise.
fn visibility(surfaces: &Surfaces, camera: &Camera, texture: DVec2, hit: &Hit) -> (bool, bool) {
    if !surfaces.shapes().iter().any(Shape::hides) {
        return (true, true);
    }
    let seen = |offset: DVec2| camera.ray(texture + offset).and_then(|ray| surfaces.hit(&ray, 0.0));
    let here = seen(DVec2::ZERO);
    let is_visible = here.is_some_and(|seen| {
        let distance = seen.distance_m;
        (seen.point_in_world - hit.point_in_world).length() < 1e-6 * distance + 1e-6
    });
    let is_uniform = (0..16).all(|step| {
        let (sin, cos) = (f64::from(step % 8) * std::f64::consts::FRAC_PI_4).sin_cos();
        let reach = SILHOUETTE * if step < 8 { 1.0 } else { 0.5 };
        surface_of(seen(DVec2::new(cos, sin) * reach).as_ref()) == surface_of(here.as_ref())
    });
    (is_visible, is_uniform)
}

fn codes(light: DVec3) -> [u8; 3] {
    light.to_array().map(|light| (f64::from(srgb_from_linear(light as f32)) * 255.0).round() as u8)
}

/// Light of a surface where no camera looks; `picture` is what lies on it, and whether the plain colour tints that.
fn material(state: &SceneState, hit: &Hit, picture: Option<(DVec3, bool)>) -> DVec3 {
    let color_srgb = state.scene.material(hit.surface).expect("a material").part_srgb(hit.part);
    let lit = |n: DVec3| 0.6 + 0.4 * n.dot(DVec3::new(-0.36, -0.48, 0.8)).max(0.0) / 0.8;
    // Light falls on the outside; a viewer inside sees the same colours from behind.
    let normal = hit.normal_in_world;
    let outward = match state.scene.surfaces.shape(hit.surface) {
        Some(Shape::Ground(_) | Shape::HeightField(_)) => normal * normal.z.signum(),
        Some(Shape::Model(mesh)) => {
            let [a, b, c] = mesh.triangles()[hit.part as usize].map(|point| mesh.points()[point as usize]);
            normal * normal.dot((b - a).cross(c - a)).signum()
        }
        _ => normal,
    };
    let light = lit(outward).min(1.0);
    match picture {
        Some((picture, false)) => picture * light,
        Some((picture, true)) => picture * linear(color_srgb) * light,
        None => linear(color_srgb) * light,
    }
}

/// A picture in linear light with its smaller levels, each kept in 8-bit sRGB.
struct Pyramid {
    size: DVec2,
    levels: Vec<Level>,
}

struct Level {
    width: usize,
    height: usize,
    linear: Vec<DVec3>,
}

impl Pyramid {
    fn new(image: &YuvImage) -> Self {
        let rgb = image.to_rgb();
        let (width, height) = (rgb.width as usize, rgb.height as usize);
        let padded = (width.next_multiple_of(16), height.next_multiple_of(16));
        let linear = (0..padded.1)
            .flat_map(|y| (0..padded.0).map(move |x| (x, y)))
            .map(|(x, y)| {
                let at = (y.min(height - 1) * width + x.min(width - 1)) * 3;
                DVec3::from(
                    [0, 1, 2].map(|c| f64::from(linear_from_srgb(f32::from(rgb.data[at + c]) / 255.0))),
                )
            })
            .collect();
        let mut levels = vec![Level { width: padded.0, height: padded.1, linear }];
        while levels.len() < N_LEVELS {
            levels.push(levels[levels.len() - 1].smaller());
        }
        Self { size: DVec2::new(width as f64, height as f64), levels }
    }

    fn sample(&self, texture: DVec2, level: f64) -> DVec3 {
        let level = level.min(N_LEVELS as f64 - 1.0);
        let lower = level.floor() as usize;
        let upper = (lower + 1).min(N_LEVELS - 1);
        self.bilinear(texture, lower).lerp(self.bilinear(texture, upper), level.fract())
    }

    fn bilinear(&self, texture: DVec2, idx: usize) -> DVec3 {
        let level = &self.levels[idx];
        let at = texture * self.size / f64::from(1_u32 << idx) - 0.5;
        let load = |x: f64, y: f64| {
            let clamped = |value: f64, size: usize| value.clamp(0.0, size as f64 - 1.0) as usize;
            level.linear[clamped(y, level.height) * level.width + clamped(x, level.width)]
        };
        let (x, y) = (at.x.floor(), at.y.floor());
        let row = |y: f64| load(x, y).lerp(load(x + 1.0, y), at.x - x);
        row(y).lerp(row(y + 1.0), at.y - y)
    }
}

impl Level {
    fn smaller(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut linear = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let at = |dx, dy| self.linear[(2 * y + dy) * self.width + 2 * x + dx];
                let mean = (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) * 0.25;
                let kept = |light: f64| {
                    let code = (srgb_from_linear(light as f32) * 255.0).round() / 255.0;
                    f64::from(linear_from_srgb(code))
                };
                linear.push(DVec3::from(mean.to_array().map(kept)));
            }
        }
        Self { width, height, linear }
    }
}
