//! The ray caster: pictures of a world with exact truth for every pixel, on the CPU in f64.
//!
//! A picture is made in two steps. A [`Plate`] is the still world without figures, cast in full; a [`Truth`] is a
//! plate with the pixels that a figure may touch cast again. Colours are the mean of a regular grid of samples in
//! linear light; everything else belongs to the pixel's centre, where one answer is true. Rows go to all cores; the
//! bytes do not depend on how many there are. Shares `geometry` with the rest and must never use the renderer that it
//! judges.

use super::SimulateError;
use super::bounds::Bounds;
use super::moment::{Actors, Moment, may_meet};
use super::shade::{Scene, What};
use super::world::{World, srgb_code};
use crate::frame::{Mask, RgbImage};
use crate::geometry::{Camera, Ray};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    /// Unit normal, in the world, of what each pixel's centre shows; 0 where it is the sky. **Shape** as depth's.
    /// Where [`Layers::normals`] are asked for.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Where each pixel's centre shows the still world in a shadow that something moving casts: 255, else 0. A
    /// shadow is where the sun, or a lamp that would add at least 5 % of the light, is hidden by what moves and by
    /// nothing that stands. Where [`Layers::shadow`] is asked for.
    pub shadow: Option<Mask>,
    /// The picture in linear light, RGB, 1 as bright as an 8-bit picture can show; brighter is kept. **Shape** as
    /// depth's. Where [`Layers::linear`] is asked for.
    pub linear: Option<Vec<[f32; 3]>>,
}

/// What of a truth is wanted beyond picture, instances and depth; what is not asked for costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Layers {
    /// Normals of what is seen.
    pub normals: bool,
    /// Shadows that what moves casts.
    pub shadow: bool,
    /// The picture in linear light.
    pub linear: bool,
}

/// Told how many of how many rows are done, from whichever thread has done one.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// How pictures are cast.
#[derive(Clone, Copy)]
pub struct CastOptions<'a> {
    /// Samples a pixel, each way, 1 to 16.
    pub samples_per_side: u32,
    /// What is wanted beside the picture.
    pub layers: Layers,
    /// Told of the progress of a full picture, row by row.
    pub progress: Option<Progress<'a>>,
}

impl CastOptions<'_> {
    /// The picture alone, with so many samples a pixel each way.
    #[must_use]
    pub const fn new(samples_per_side: u32) -> Self {
        let layers = Layers { normals: false, shadow: false, linear: false };
        Self { samples_per_side, layers, progress: None }
    }
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
        center_ray(&self.camera, x, y)
    }
}

fn ray(camera: &Camera, x: usize, y: usize, in_pixel: DVec2) -> Option<Ray> {
    let (width, height) = camera.size_px();
    let at = DVec2::new(x as f64, y as f64) + in_pixel;
    camera.ray(at / DVec2::new(f64::from(width), f64::from(height)))
}

/// The ray through a pixel's centre, where the lens brings light.
pub(super) fn center_ray(camera: &Camera, x: usize, y: usize) -> Option<Ray> {
    ray(camera, x, y, DVec2::splat(0.5))
}

/// Refuses numbers of samples with which no picture is made.
pub(super) const fn check_samples(samples_per_side: u32) -> Result<(), SimulateError> {
    if samples_per_side == 0 || samples_per_side > 16 { Err(SimulateError::Samples) } else { Ok(()) }
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
        self.plate_with(camera, &CastOptions::new(samples_per_side))
    }

    /// As [`Self::plate`], with the layers that the options name; every picture over the plate has the same.
    ///
    /// # Errors
    /// When there are not 1 to 16 samples a side.
    pub fn plate_with(&self, camera: &Camera, options: &CastOptions<'_>) -> Result<Plate, SimulateError> {
        check_samples(options.samples_per_side)?;
        let moment = Moment::bare();
        let scene = Scene { world: self, moment: &moment };
        let caster = Caster { scene, camera, samples_per_side: options.samples_per_side };
        let mut truth = blank(camera, options.layers);
        caster.cast_where(&mut truth, options.progress, |_| true);
        Ok(Plate { camera: camera.clone(), samples_per_side: options.samples_per_side, truth })
    }

    /// The picture at `time_secs` of the camera that took `plate`, with the plate's layers.
    ///
    /// Equal to [`Self::render`] in every byte, at the cost of the pixels near figures alone.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub fn render_over(&self, plate: &Plate, time_secs: f64) -> Result<Truth, SimulateError> {
        let moment = Moment { actors: Actors::new(self.bodies(time_secs)?), ..Moment::bare() };
        let Plate { camera, samples_per_side, truth } = plate;
        let scene = Scene { world: self, moment: &moment };
        let caster = Caster { scene, camera, samples_per_side: *samples_per_side };
        // A pixel's corner lies 0.71 pixels from its centre; a lens that spreads its pixels more than half as wide
        // again would be no mild one.
        let spread = 1.1 / camera.focal_px().min_element();
        let bounds: Vec<Bounds> = moment.actors.bounds().collect();
        let mut truth = truth.clone();
        caster.cast_where(&mut truth, None, |ray| bounds.iter().any(|bounds| may_meet(bounds, ray, spread)));
        Ok(truth)
    }
}

/// A truth of which nothing is known.
fn blank(camera: &Camera, layers: Layers) -> Truth {
    let (width, height) = camera.size_px();
    let n_pixels = width as usize * height as usize;
    Truth {
        rgb: RgbImage { width, height, data: vec![0; n_pixels * 3] },
        instance: Mask::filled(width, height, 0),
        depth_m: vec![0.0; n_pixels],
        normals: layers.normals.then(|| vec![[0.0; 3]; n_pixels]),
        shadow: layers.shadow.then(|| Mask::filled(width, height, 0)),
        linear: layers.linear.then(|| vec![[0.0; 3]; n_pixels]),
    }
}

/// A row of a truth, written by one thread.
struct Row<'a> {
    rgb: &'a mut [u8],
    instance: &'a mut [u8],
    depth_m: &'a mut [f32],
    normals: Option<&'a mut [[f32; 3]]>,
    shadow: Option<&'a mut [u8]>,
    linear: Option<&'a mut [[f32; 3]]>,
}

/// The rows of a truth, from the top.
fn rows(truth: &mut Truth) -> Vec<Row<'_>> {
    let width = truth.rgb.width as usize;
    let mut normals = truth.normals.as_mut().map(|layer| layer.chunks_mut(width));
    let mut shadow = truth.shadow.as_mut().map(|layer| layer.data.chunks_mut(width));
    let mut linear = truth.linear.as_mut().map(|layer| layer.chunks_mut(width));
    let always = (truth.rgb.data.chunks_mut(width * 3))
        .zip(truth.instance.data.chunks_mut(width))
        .zip(truth.depth_m.chunks_mut(width));
    let row = |((rgb, instance), depth_m)| Row {
        rgb,
        instance,
        depth_m,
        normals: normals.as_mut().and_then(Iterator::next),
        shadow: shadow.as_mut().and_then(Iterator::next),
        linear: linear.as_mut().and_then(Iterator::next),
    };
    always.map(row).collect()
}

struct Caster<'a> {
    scene: Scene<'a>,
    camera: &'a Camera,
    samples_per_side: u32,
}

impl Caster<'_> {
    /// Casts every pixel whose centre's ray `is_wanted`, row by row in parallel.
    fn cast_where(
        &self,
        truth: &mut Truth,
        progress: Option<Progress<'_>>,
        is_wanted: impl Fn(&Ray) -> bool + Sync,
    ) {
        let rows = rows(truth);
        let (n_rows, n_done) = (rows.len(), AtomicUsize::new(0));
        rows.into_par_iter().enumerate().for_each(|(y, mut row)| {
            for x in 0..row.depth_m.len() {
                if let Some(center) = center_ray(self.camera, x, y).filter(&is_wanted) {
                    self.pixel(&mut row, x, y, &center);
                }
            }
            if let Some(progress) = progress {
                progress(n_done.fetch_add(1, Ordering::Relaxed) + 1, n_rows);
            }
        });
    }

    fn pixel(&self, row: &mut Row<'_>, x: usize, y: usize, center: &Ray) {
        let n = self.samples_per_side;
        let width_for_a_metre = 1.0 / (self.camera.focal_px().max_element() * f64::from(n));
        let mut sum = DVec3::ZERO;
        for sample in 0..n * n {
            let in_pixel = (DVec2::new(f64::from(sample % n), f64::from(sample / n)) + 0.5) / f64::from(n);
            if let Some(ray) = ray(self.camera, x, y, in_pixel) {
                sum += self.scene.light(&ray, width_for_a_metre);
            }
        }
        let mean = sum / f64::from(n * n);
        row.rgb[x * 3..x * 3 + 3].copy_from_slice(&mean.to_array().map(srgb_code));
        if let Some(linear) = &mut row.linear {
            linear[x] = mean.as_vec3().to_array();
        }
        let met = self.scene.meet(center);
        let along_axis = center.direction.dot(self.camera.pose().forward_in_world());
        row.depth_m[x] = met.map_or(0.0, |met| (met.distance_m * along_axis) as f32);
        row.instance[x] = met.map_or(0, |met| match met.what {
            What::Actor { instance, .. } => instance,
            What::Solid(_) => 0,
        });
        if let Some(normals) = &mut row.normals {
            normals[x] = met.map_or([0.0; 3], |met| met.normal.as_vec3().to_array());
        }
        if let Some(shadow) = &mut row.shadow {
            let is_shaded = met.is_some_and(|met| {
                matches!(met.what, What::Solid(_)) && self.scene.is_in_shadow_of_actor(&met)
            });
            shadow[x] = if is_shaded { 255 } else { 0 };
        }
    }
}
