//! What pictures on surfaces and skies must look like, in f64: where a picture lies is found anew from the shape and the
//! point, not from triangles; its levels are made anew from its finest.

use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::scene::{Paint, Repeated, Sky, Texture, Wrap};
use videofields_vision::frame::{linear_from_srgb, srgb_from_linear};
use videofields_vision::geometry::{Hit, Shape};

const N_TAPS: u32 = 4;
/// Below one degree the ground counts in full.
const HAZE: f64 = 0.017_452_4;

pub(super) fn linear(color: [u8; 3]) -> DVec3 {
    DVec3::from(color.map(|code| f64::from(linear_from_srgb(f32::from(code) / 255.0))))
}

/// The scene's pictures in linear light, each with its levels.
pub(super) struct Painter {
    pictures: Vec<(*const Texture, Picture)>,
}

impl Painter {
    pub(super) fn new(state: &SceneState) -> Self {
        let mut found: Vec<&Arc<Texture>> = Vec::new();
        for paint in state.scene.materials.iter().filter_map(|material| material.paint.as_deref()) {
            match paint {
                Paint::Repeated { walls, level } => {
                    found.extend([walls, level].into_iter().flatten().map(|repeated| &repeated.picture));
                }
                Paint::Registered { picture, .. } => found.push(picture),
                Paint::Mapped { pictures, .. } => found.extend(pictures),
            }
        }
        if let Sky::Picture { texture, .. } = &state.scene.sky {
            found.push(texture);
        }
        let mut pictures: Vec<(*const Texture, Picture)> = Vec::new();
        for texture in found {
            if pictures.iter().all(|(known, _)| *known != Arc::as_ptr(texture)) {
                pictures.push((Arc::as_ptr(texture), Picture::new(texture)));
            }
        }
        Self { pictures }
    }

    fn picture(&self, texture: &Arc<Texture>) -> &Picture {
        let found = self.pictures.iter().find(|(known, _)| *known == Arc::as_ptr(texture));
        &found.expect("every picture was found").1
    }

    /// The picture's light at a hit before it is tinted, whether the plain colour tints it, and whether there is one
    /// answer; `None` where the surface is plain.
    pub(super) fn at(
        &self,
        state: &SceneState,
        hit: &Hit,
        steps: &[DVec3; 2],
    ) -> (Option<(DVec3, bool)>, bool) {
        let Some(paint) = state.scene.material(hit.surface).and_then(|material| material.paint.as_deref())
        else {
            return (None, true);
        };
        let shape = state.scene.surfaces.shape(hit.surface).expect("a shape");
        let Some((texture, place, ends)) = place(paint, shape, hit, hit.point_in_world) else {
            return (None, true);
        };
        let inset = place.min(1.0 - place).min_element();
        if ends && inset < 0.0 {
            return (None, inset < -1e-3);
        }
        let step = |step: &DVec3| {
            let further = self::place(paint, shape, hit, hit.point_in_world + *step);
            further.map_or(DVec2::ZERO, |(_, further, _)| further - place)
        };
        let light = self.picture(texture).filtered(place, [step(&steps[0]), step(&steps[1])]);
        (Some((light, matches!(paint, Paint::Mapped { .. }))), !ends || inset > 1e-3)
    }

    /// The sky's light in a direction; `steps` lead to the directions of the pixels beside it.
    pub(super) fn sky(&self, sky: &Sky, direction: DVec3, steps: &[DVec3; 2]) -> DVec3 {
        match sky {
            Sky::Plain { color_srgb } => linear(*color_srgb),
            Sky::Gradient { zenith_srgb, horizon_srgb, ground_srgb } => {
                let [zenith, horizon, ground] =
                    [zenith_srgb, horizon_srgb, ground_srgb].map(|color| linear(*color));
                let above = horizon.lerp(zenith, direction.z.max(0.0));
                let share = (-direction.z / HAZE).clamp(0.0, 1.0);
                above.lerp(ground, share * share * (3.0 - 2.0 * share))
            }
            Sky::Picture { texture, yaw_rad } => {
                let picture = self.picture(texture);
                let azimuth = direction.y.atan2(direction.x);
                let place =
                    DVec2::new(0.5 - (azimuth - yaw_rad) / TAU, direction.z.clamp(-1.0, 1.0).acos() / PI);
                let pixel_rad = steps[0].length().max(steps[1].length());
                let texels = pixel_rad * picture.size().y / PI;
                picture.sample(place, texels.max(1e-6).log2().max(0.0))
            }
        }
    }
}

/// Where in which picture a point on the plane of a hit lies, and whether the picture ends there.
fn place<'a>(
    paint: &'a Paint,
    shape: &Shape,
    hit: &Hit,
    point: DVec3,
) -> Option<(&'a Arc<Texture>, DVec2, bool)> {
    match paint {
        Paint::Registered { picture, map } => {
            let at = map.texture_at(point.truncate());
            // Beyond its horizon a picture shows nothing.
            Some((picture, if at.z > 0.0 { at.truncate() / at.z } else { DVec2::splat(-9.0) }, true))
        }
        Paint::Repeated { walls, level } => {
            let (is_wall, along, around_m) = on_face(shape, hit, point)?;
            let Repeated { picture, size_m } = if is_wall { walls.as_ref()? } else { level.as_ref()? };
            let width_m =
                around_m.map_or(size_m.x, |around: f64| around / (around / size_m.x).round().max(1.0));
            Some((picture, DVec2::new(along.x / width_m, 1.0 - along.y / size_m.y), false))
        }
        Paint::Mapped { pictures, triangles } => {
            let Shape::Model(mesh) = shape else { panic!("models alone are mapped") };
            let mapped = triangles[hit.part as usize];
            let picture = &pictures[usize::from(mapped.picture?)];
            let [a, b, c] = mesh.triangles()[hit.part as usize].map(|at| mesh.points()[at as usize]);
            let normal = (b - a).cross(c - a);
            let share =
                |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(normal) / normal.length_squared();
            let [u, v, w] = mapped.corners.map(|[s, t]| DVec2::new(s.into(), t.into()));
            Some((picture, u * share(b, c) + v * share(c, a) + w * share(a, b), false))
        }
    }
}

/// Whether a wall was hit, metres from its lower left corner, and how long it is if it is round.
fn on_face(shape: &Shape, hit: &Hit, point: DVec3) -> Option<(bool, DVec2, Option<f64>)> {
    let (low, _) = shape.bounds();
    let level = Some((false, (point - low).truncate(), None));
    match (shape, hit.part) {
        (Shape::Ground(_) | Shape::HeightField(_), _) => level,
        (Shape::Box(solid), part) => {
            let axis = |axis: DVec3| solid.world_from_box_point(axis) - solid.center();
            let [x, y] = [DVec3::X, DVec3::Y].map(|unit| (point - solid.center()).dot(axis(unit)));
            let half = solid.half_size();
            let up = point.z - solid.center().z + half.z;
            match part {
                0 => Some((true, DVec2::new(half.y + y, up), None)),
                1 => Some((true, DVec2::new(half.y - y, up), None)),
                2 => Some((true, DVec2::new(half.x - x, up), None)),
                3 => Some((true, DVec2::new(half.x + x, up), None)),
                4 => Some((false, DVec2::new(half.x + x, half.y + y), None)),
                _ => None,
            }
        }
        (Shape::Cylinder(_) | Shape::Footprint(_), 1) => None,
        (Shape::Cylinder(_) | Shape::Footprint(_), 0) => level,
        (Shape::Cylinder(cylinder), _) => {
            let (base, radius_m) = (cylinder.base(), cylinder.radius_m());
            let met = (hit.point_in_world - base).truncate();
            let turn = met.to_angle().rem_euclid(TAU) + met.angle_to((point - base).truncate());
            Some((true, DVec2::new(turn * radius_m, point.z - base.z), Some(TAU * radius_m)))
        }
        (Shape::Footprint(footprint), part) => {
            let corners = footprint.corners();
            let idx = part as usize - 2;
            let (from, to) = (corners[idx], corners[(idx + 1) % corners.len()]);
            let along = (point.truncate() - from).dot((to - from).normalize());
            Some((true, DVec2::new(along, point.z - footprint.base_and_top_m()[0]), None))
        }
        (Shape::Model(_), _) => None,
    }
}

/// A picture in linear light with its levels, each kept in 8-bit sRGB.
struct Picture {
    levels: Vec<(usize, usize, Vec<DVec3>)>,
    wraps: [Wrap; 2],
}

impl Picture {
    fn new(texture: &Texture) -> Self {
        let finest = &texture.levels()[0];
        let light = finest.texels.as_chunks::<4>().0.iter().map(|[r, g, b, _]| linear([*r, *g, *b]));
        let mut levels = vec![(finest.width_px as usize, finest.height_px as usize, light.collect())];
        while let Some(level) = levels.last().filter(|(width, height, _)| width * height > 1) {
            levels.push(smaller(level));
        }
        Self { levels, wraps: texture.wraps() }
    }

    fn size(&self) -> DVec2 {
        DVec2::new(self.levels[0].0 as f64, self.levels[0].1 as f64)
    }

    /// As `EXT_texture_filter_anisotropic` describes it, with `N_TAPS` places.
    fn filtered(&self, place: DVec2, [x, y]: [DVec2; 2]) -> DVec3 {
        let [length_x, length_y] = [x, y].map(|step| (step * self.size()).length());
        let (longer, shorter) = (length_x.max(length_y), length_x.min(length_y));
        let level = (longer / f64::from(N_TAPS)).max(shorter).max(1e-6).log2().max(0.0);
        let along = if length_x >= length_y { x } else { y } * (1.0 - shorter / longer.max(1e-12));
        let tap = |tap: u32| {
            let share = (f64::from(tap) + 0.5) / f64::from(N_TAPS) - 0.5;
            self.sample(place + along * share, level)
        };
        (0..N_TAPS).map(tap).sum::<DVec3>() / f64::from(N_TAPS)
    }

    fn sample(&self, place: DVec2, level: f64) -> DVec3 {
        let level = level.min(self.levels.len() as f64 - 1.0);
        let lower = level.floor() as usize;
        let upper = (lower + 1).min(self.levels.len() - 1);
        self.bilinear(place, lower).lerp(self.bilinear(place, upper), level.fract())
    }

    fn bilinear(&self, place: DVec2, level: usize) -> DVec3 {
        let (width, height, light) = &self.levels[level];
        let at = place * DVec2::new(*width as f64, *height as f64) - 0.5;
        let wrapped = |value: f64, size: usize, wrap: Wrap| {
            let (value, n) = (value as i64, size as i64);
            (match wrap {
                Wrap::Clamp => value.clamp(0, n - 1),
                Wrap::Repeat => value.rem_euclid(n),
                Wrap::Mirror => {
                    let turn = value.rem_euclid(2 * n);
                    if turn < n { turn } else { 2 * n - 1 - turn }
                }
            }) as usize
        };
        let load = |x: f64, y: f64| {
            light[wrapped(y, *height, self.wraps[1]) * width + wrapped(x, *width, self.wraps[0])]
        };
        let (x, y) = (at.x.floor(), at.y.floor());
        let row = |y: f64| load(x, y).lerp(load(x + 1.0, y), at.x - x);
        row(y).lerp(row(y + 1.0), at.y - y)
    }
}

/// Half as wide and high, rounded down: the mean of what each texel covers, by its share of each.
fn smaller((width, height, light): &(usize, usize, Vec<DVec3>)) -> (usize, usize, Vec<DVec3>) {
    let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
    let overlap = |coarse: usize, n_coarse: usize, fine: usize, n_fine: usize| {
        let extent = n_fine as f64 / n_coarse as f64;
        let (low, high) = (coarse as f64 * extent, (coarse + 1) as f64 * extent);
        (high.min(fine as f64 + 1.0) - low.max(fine as f64)).max(0.0) / extent
    };
    let mut coarser = Vec::new();
    for y in 0..half_height {
        for x in 0..half_width {
            let mut mean = DVec3::ZERO;
            // No texel covers more than three each way.
            for fine_y in (2 * y)..(2 * y + 3).min(*height) {
                for fine_x in (2 * x)..(2 * x + 3).min(*width) {
                    let share =
                        overlap(x, half_width, fine_x, *width) * overlap(y, half_height, fine_y, *height);
                    mean += light[fine_y * width + fine_x] * share;
                }
            }
            let code = |light: f64| (srgb_from_linear(light as f32) * 255.0).round() as u8;
            coarser.push(linear(mean.to_array().map(code)));
        }
    }
    (half_width, half_height, coarser)
}
