//! The ray caster: pictures of a world with exact truth for every pixel, on the CPU in f64.
//!
//! A picture is made in two steps. A [`Plate`] is the still world without figures, cast in full; a [`Truth`] is a
//! plate with the pixels that a figure may touch cast again. Colours are the mean of a regular grid of samples in
//! linear light; instance and depth are those of the pixel's centre. Shares `geometry` with the rest and must never
//! use the renderer that it judges.

use super::SimulateError;
use super::figure::Body;
use super::world::{World, srgb_code};
use crate::frame::{Mask, RgbImage};
use crate::geometry::{Camera, Ray};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// A picture and everything that is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// The picture, 8-bit sRGB.
    pub rgb: RgbImage,
    /// What each pixel's centre shows: 0 the still world, else a figure's instance.
    pub instance: Mask,
    /// Distance of what each pixel's centre shows along the optical axis, metres; 0 where it is the sky or the
    /// lens brings no light. **Shape** height x width, row-major.
    pub depth_m: Vec<f32>,
}

/// The still world without figures as one camera sees it.
#[derive(Clone, Debug)]
pub struct Plate {
    camera: Camera,
    samples_per_side: u32,
    truth: Truth,
}

impl Plate {
    /// The picture of the still world; every instance is 0.
    #[must_use]
    pub const fn truth(&self) -> &Truth {
        &self.truth
    }

    pub(super) const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The ray through a pixel's centre, where the lens brings light.
    pub(super) fn center_ray(&self, x: usize, y: usize) -> Option<Ray> {
        ray(&self.camera, x, y, DVec2::splat(0.5))
    }
}

fn ray(camera: &Camera, x: usize, y: usize, in_pixel: DVec2) -> Option<Ray> {
    let (width, height) = camera.size_px();
    let at = DVec2::new(x as f64, y as f64) + in_pixel;
    camera.ray(at / DVec2::new(f64::from(width), f64::from(height)))
}

/// Refuses numbers of samples with which no picture is made.
pub(super) const fn check_samples(samples_per_side: u32) -> Result<(), SimulateError> {
    if samples_per_side == 0 || samples_per_side > 16 { Err(SimulateError::Samples) } else { Ok(()) }
}

/// What a pixel holds.
struct Pixel {
    rgb: [u8; 3],
    instance: u8,
    depth_m: f32,
}

/// What a ray meets.
struct Seen {
    light: DVec3,
    instance: u8,
    distance_m: f64,
}

impl World {
    /// The picture that `camera` takes at `time_secs`, with `samples_per_side` squared samples a pixel.
    ///
    /// # Errors
    /// When the time is not a finite number or there are not 1 to 16 samples a side.
    pub fn render(
        &self,
        camera: &Camera,
        time_secs: f64,
        samples_per_side: u32,
    ) -> Result<Truth, SimulateError> {
        let plate = self.plate(camera, samples_per_side)?;
        self.render_over(&plate, time_secs)
    }

    /// The still world as `camera` sees it.
    ///
    /// **Cost** about 1 microsecond for each sample.
    ///
    /// # Errors
    /// When there are not 1 to 16 samples a side.
    pub fn plate(&self, camera: &Camera, samples_per_side: u32) -> Result<Plate, SimulateError> {
        check_samples(samples_per_side)?;
        let (width, height) = camera.size_px();
        let n_pixels = width as usize * height as usize;
        let mut truth = Truth {
            rgb: RgbImage { width, height, data: vec![0; n_pixels * 3] },
            instance: Mask::filled(width, height, 0),
            depth_m: vec![0.0; n_pixels],
        };
        let caster = Caster { world: self, camera, samples_per_side, bodies: &[] };
        caster.cast_where(&mut truth, |_| true);
        Ok(Plate { camera: camera.clone(), samples_per_side, truth })
    }

    /// The picture at `time_secs` of the camera that took `plate`.
    ///
    /// Equal to [`Self::render`] in every byte, at the cost of the pixels near figures alone.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub fn render_over(&self, plate: &Plate, time_secs: f64) -> Result<Truth, SimulateError> {
        let bodies = self.bodies(time_secs)?;
        let Plate { camera, samples_per_side, truth } = plate;
        let caster = Caster { world: self, camera, samples_per_side: *samples_per_side, bodies: &bodies };
        // A pixel's corner lies 0.71 pixels from its centre; a lens that spreads its pixels more than half as wide
        // again would be no mild one.
        let spread = 1.1 / camera.focal_px().min_element();
        let mut truth = truth.clone();
        caster.cast_where(&mut truth, |ray| bodies.iter().any(|body| body.may_meet(ray, spread)));
        Ok(truth)
    }
}

struct Caster<'a> {
    world: &'a World,
    camera: &'a Camera,
    samples_per_side: u32,
    bodies: &'a [Body],
}

impl Caster<'_> {
    /// Casts every pixel whose centre's ray `is_wanted`, row by row in parallel.
    fn cast_where(&self, truth: &mut Truth, is_wanted: impl Fn(&Ray) -> bool + Sync) {
        let (width, _) = self.camera.size_px();
        let width = width as usize;
        let rows = (truth.rgb.data.par_chunks_mut(width * 3))
            .zip(truth.instance.data.par_chunks_mut(width))
            .zip(truth.depth_m.par_chunks_mut(width));
        rows.enumerate().for_each(|(y, ((rgb, instance), depth_m))| {
            let pixels = rgb.chunks_exact_mut(3).zip(instance).zip(depth_m);
            for (x, ((rgb, instance), depth_m)) in pixels.enumerate() {
                let Some(center) = ray(self.camera, x, y, DVec2::splat(0.5)) else { continue };
                if is_wanted(&center) {
                    let pixel = self.pixel(x, y, &center);
                    rgb.copy_from_slice(&pixel.rgb);
                    (*instance, *depth_m) = (pixel.instance, pixel.depth_m);
                }
            }
        });
    }

    fn pixel(&self, x: usize, y: usize, center: &Ray) -> Pixel {
        let n = self.samples_per_side;
        let width_for_a_metre = 1.0 / (self.camera.focal_px().max_element() * f64::from(n));
        let mut sum = DVec3::ZERO;
        for sample in 0..n * n {
            let in_pixel = (DVec2::new(f64::from(sample % n), f64::from(sample / n)) + 0.5) / f64::from(n);
            if let Some(ray) = ray(self.camera, x, y, in_pixel) {
                sum += self.seen(&ray, width_for_a_metre).light;
            }
        }
        let seen = self.seen(center, width_for_a_metre);
        let along_axis = center.direction.dot(self.camera.pose().forward_in_world());
        Pixel {
            rgb: (sum / f64::from(n * n)).to_array().map(srgb_code),
            instance: seen.instance,
            depth_m: if seen.distance_m.is_finite() { (seen.distance_m * along_axis) as f32 } else { 0.0 },
        }
    }

    fn seen(&self, ray: &Ray, width_for_a_metre: f64) -> Seen {
        let hit = self.world.surfaces.hit(ray, 0.0);
        let still_distance = hit.map_or(f64::INFINITY, |hit| hit.distance_m);
        let figure = self
            .bodies
            .iter()
            .zip(1_u8..)
            .filter(|(body, _)| body.may_meet(ray, 0.0))
            .filter_map(|(body, instance)| Some((body.entry(ray)?, instance)))
            .filter(|((entry, _), _)| entry.distance_m < still_distance)
            .min_by(|((a, _), _), ((b, _), _)| a.distance_m.total_cmp(&b.distance_m));
        if let Some(((entry, color), instance)) = figure {
            let place = ray.at(entry.distance_m);
            let light = color * self.world.light.on(place, entry.normal, &self.world.surfaces);
            return Seen { light, instance, distance_m: entry.distance_m };
        }
        let light = hit.map_or(self.world.sky, |hit| {
            let cosine = ray.direction.dot(hit.normal_in_world).abs();
            self.world.surface_light(&hit, width_for_a_metre * hit.distance_m, cosine)
        });
        Seen { light, instance: 0, distance_m: still_distance }
    }
}
