//! The ray caster: pictures of a world with exact truth for every pixel, on the CPU in f64.
//!
//! A picture is made in two steps. A [`Plate`] is the still world without figures, cast in full; a [`Truth`] is a
//! plate with the pixels that a figure may touch cast again. Colours are the mean of a regular grid of samples in
//! linear light; everything else belongs to the pixel's centre, where one answer is true. Rows go to all cores; the
//! bytes do not depend on how many there are. Shares `geometry` with the rest and must never use the renderer that it
//! judges.

use super::SimulateError;
use super::effects::{Draw, Tally};
use super::moment::{Moment, Moments, Shot, Shutter, may_meet};
use super::shade::{Sample, Scene, What};
use super::world::{World, srgb_code};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::{Camera, Ray};

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
    /// Where something moving covers a part of a pixel, of the samples that make its colour, and not the whole: 255,
    /// else 0. Where [`Layers::partial`] is asked for.
    pub partial: Option<Mask>,
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
    /// Pixels that something moving covers in part.
    pub partial: bool,
    /// The picture in linear light.
    pub linear: bool,
}

impl Layers {
    /// The picture, instances and depth alone.
    pub const NONE: Self = Self { normals: false, shadow: false, partial: false, linear: false };
    /// Everything.
    pub const ALL: Self = Self { normals: true, shadow: true, partial: true, linear: true };
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
        Self { samples_per_side, layers: Layers::NONE, progress: None }
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
    /// The picture of a view at `time_secs`, with `samples_per_side` squared samples a pixel.
    ///
    /// # Errors
    /// When the time is not a finite number or there are not 1 to 16 samples a side.
    pub fn render(
        &self,
        camera: &Camera,
        time_secs: f64,
        samples_per_side: u32,
    ) -> Result<Truth, SimulateError> {
        let shot = Shot { camera, device: None, time_secs };
        self.cast(&shot, &CastOptions::new(samples_per_side))
    }

    /// The picture of a shot: what a camera of the world takes, effects of its motion and shutter included, or a
    /// view.
    ///
    /// # Errors
    /// When the time is not a finite number, there are not 1 to 16 samples a side, or the camera's shake takes it out
    /// of the world (1e8 m).
    pub fn cast(&self, shot: &Shot<'_>, options: &CastOptions<'_>) -> Result<Truth, SimulateError> {
        check_samples(options.samples_per_side)?;
        let moments = self.moments(shot)?;
        let caster = Caster::new(self, &moments, self.shutter(shot), options.samples_per_side);
        let mut truth = blank(shot.camera, options.layers);
        caster.cast_where(&mut truth, options.progress, |_, _| true);
        Ok(truth)
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
        let moments = Moments::one(Moment::bare(camera));
        let shot = Shot { camera, device: None, time_secs: 0.0 };
        let caster = Caster::new(self, &moments, self.shutter(&shot), options.samples_per_side);
        let mut truth = blank(camera, options.layers);
        caster.cast_where(&mut truth, options.progress, |_, _| true);
        Ok(Plate { camera: camera.clone(), samples_per_side: options.samples_per_side, truth })
    }

    /// The picture at `time_secs` of the view that took `plate`, with the plate's layers.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub fn render_over(&self, plate: &Plate, time_secs: f64) -> Result<Truth, SimulateError> {
        self.cast_over(plate, None, time_secs)
    }

    /// The picture at `time_secs` of the camera that took `plate`, with the plate's layers; `device` as in [`Shot`].
    ///
    /// Equal to [`Self::cast`] in every byte. **Cost** that of the pixels near what moves, where the world names
    /// nothing that changes others ([`Self::plates_last_for_cameras`], [`Self::plates_last_for_views`]); else that of
    /// the whole picture.
    ///
    /// # Errors
    /// As [`Self::cast`].
    pub fn cast_over(
        &self,
        plate: &Plate,
        device: Option<&str>,
        time_secs: f64,
    ) -> Result<Truth, SimulateError> {
        let Plate { camera, samples_per_side, truth } = plate;
        let shot = Shot { camera, device, time_secs };
        let moments = self.moments(&shot)?;
        let caster = Caster::new(self, &moments, self.shutter(&shot), *samples_per_side);
        let mut truth = truth.clone();
        if self.plate_lasts(device) {
            let bounds = moments.actor_bounds();
            let spread = pixel_spread(camera);
            let may_move = |ray: &Ray| bounds.iter().any(|bounds| may_meet(bounds, ray, spread));
            caster.cast_where(&mut truth, None, |x, y| {
                center_ray(camera, x, y).is_some_and(|ray| may_move(&ray))
            });
        } else {
            caster.cast_where(&mut truth, None, |_, _| true);
        }
        Ok(truth)
    }

    /// Whether the still world looks the same in all frames of a view, so that a plate is cast once and a frame costs
    /// the pixels near what moves: no effect changes its light or its crowns, and nothing that moves casts shadows or
    /// is mirrored.
    #[must_use]
    pub fn plates_last_for_views(&self) -> bool {
        let effects = &self.effects;
        let is_still = effects.light_drift.is_none()
            && effects.light_switching.is_none()
            && effects.foliage_motion.is_none();
        let is_alone =
            effects.wet_ground.is_none() && effects.cast_shadows.is_none_or(|shadows| !shadows.actors_cast());
        is_still && is_alone
    }

    /// As [`Self::plates_last_for_views`], for a camera of the world: that it does not shake either.
    #[must_use]
    pub fn plates_last_for_cameras(&self) -> bool {
        self.plates_last_for_views() && self.effects.camera_shake.is_none()
    }

    /// Whether a plate of this shot's taker lasts; `device` as in [`Shot`].
    pub(super) fn plate_lasts(&self, device: Option<&str>) -> bool {
        if device.is_some() { self.plates_last_for_cameras() } else { self.plates_last_for_views() }
    }
}

/// How wide a cone around the ray through a pixel's centre holds all rays through the pixel, metres for each metre
/// of distance: a corner lies 0.71 pixels from its centre, and a lens spreads no pixel half as wide again as the
/// widest of those on a fine grid.
fn pixel_spread(camera: &Camera) -> f64 {
    const STEPS: u32 = 32;
    let (width, height) = camera.size_px();
    let direction = |x: f64, y: f64| {
        camera.ray(DVec2::new(x / f64::from(width), y / f64::from(height))).map(|ray| ray.direction)
    };
    let mut widest = 0.0_f64;
    for step in 0..=STEPS * STEPS {
        let share = DVec2::new(f64::from(step % STEPS), f64::from(step / STEPS)) / f64::from(STEPS);
        let at = share * DVec2::new(f64::from(width), f64::from(height));
        if let (Some(here), Some(right), Some(below)) =
            (direction(at.x, at.y), direction(at.x + 1.0, at.y), direction(at.x, at.y + 1.0))
        {
            widest = widest.max((right - here).length()).max((below - here).length());
        }
    }
    1.1 * widest.max(1.0 / camera.focal_px().min_element())
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
        partial: layers.partial.then(|| Mask::filled(width, height, 0)),
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
    partial: Option<&'a mut [u8]>,
    linear: Option<&'a mut [[f32; 3]]>,
}

/// The rows of a truth, from the top.
fn rows(truth: &mut Truth) -> Vec<Row<'_>> {
    let width = truth.rgb.width as usize;
    let mut normals = truth.normals.as_mut().map(|layer| layer.chunks_mut(width));
    let mut shadow = truth.shadow.as_mut().map(|layer| layer.data.chunks_mut(width));
    let mut partial = truth.partial.as_mut().map(|layer| layer.data.chunks_mut(width));
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
        partial: partial.as_mut().and_then(Iterator::next),
        linear: linear.as_mut().and_then(Iterator::next),
    };
    always.map(row).collect()
}

struct Caster<'a> {
    world: &'a World,
    moments: &'a Moments,
    shutter: Shutter<'a>,
    samples_per_side: u32,
    draw: Draw,
}

impl<'a> Caster<'a> {
    fn new(world: &'a World, moments: &'a Moments, shutter: Shutter<'a>, samples_per_side: u32) -> Self {
        let draw = Draw::of_camera(world.effects.seed, "light");
        Self { world, moments, shutter, samples_per_side, draw }
    }

    fn scene<'b>(&'b self, offset_secs: f64, tally: &'b Tally<'b>) -> Scene<'b> {
        Scene { world: self.world, moment: self.moments.at(offset_secs), tally, draw: self.draw }
    }

    /// Casts every pixel that `is_wanted`, row by row in parallel.
    fn cast_where(
        &self,
        truth: &mut Truth,
        progress: Option<Progress<'_>>,
        is_wanted: impl Fn(usize, usize) -> bool + Sync,
    ) {
        let rows = rows(truth);
        let (n_rows, n_done) = (rows.len(), AtomicUsize::new(0));
        rows.into_par_iter().enumerate().for_each(|(y, mut row)| {
            let tally = self.world.entries.tally();
            let row_secs = match (self.shutter.effects.rolling_shutter, self.shutter.draw) {
                (Some(rolling), Some(_)) => rolling.offset_secs(y as u32, n_rows as u32, &tally),
                _ => 0.0,
            };
            for x in (0..row.depth_m.len()).filter(|x| is_wanted(*x, y)) {
                self.pixel(&mut row, x, y, row_secs, &tally);
            }
            if let Some(progress) = progress {
                progress(n_done.fetch_add(1, Ordering::Relaxed) + 1, n_rows);
            }
        });
    }

    fn pixel(&self, row: &mut Row<'_>, x: usize, y: usize, row_secs: f64, tally: &Tally<'_>) {
        let scene = self.scene(row_secs, tally);
        let camera = &scene.moment.camera;
        let Some(center) = center_ray(camera, x, y) else { return };
        let (mean, is_partial) = self.mean_light(x, y, row_secs, tally);
        row.rgb[x * 3..x * 3 + 3].copy_from_slice(&mean.to_array().map(srgb_code));
        if let Some(linear) = &mut row.linear {
            linear[x] = mean.as_vec3().to_array();
        }
        if let Some(partial) = &mut row.partial {
            partial[x] = if is_partial { 255 } else { 0 };
        }
        let met = scene.meet(&center);
        let along_axis = center.direction.dot(camera.pose().forward_in_world());
        row.depth_m[x] = met.map_or(0.0, |met| (met.distance_m * along_axis) as f32);
        row.instance[x] = met.map_or(0, |met| match met.what {
            What::Actor { instance, .. } => instance,
            What::Solid(_) => 0,
        });
        if let Some(normals) = &mut row.normals {
            normals[x] = met.map_or([0.0; 3], |met| met.normal.as_vec3().to_array());
        }
        if let Some(shadow) = &mut row.shadow {
            let is_shaded = met
                .is_some_and(|met| matches!(met.what, What::Solid(_)) && scene.is_in_shadow_of_actor(&met));
            shadow[x] = if is_shaded { 255 } else { 0 };
        }
    }

    /// The mean of a pixel's samples, and whether some of them and not all show something moving; those to which the
    /// lens brings no light are black.
    fn mean_light(&self, x: usize, y: usize, row_secs: f64, tally: &Tally<'_>) -> (DVec3, bool) {
        let n = self.samples_per_side;
        let mut scene = self.scene(row_secs, tally);
        let (width, _) = scene.moment.camera.size_px();
        let pixel = y as u64 * u64::from(width) + x as u64;
        let width_for_a_metre = 1.0 / (scene.moment.camera.focal_px().max_element() * f64::from(n));
        let (mut sum, mut n_moving) = (DVec3::ZERO, 0);
        for idx in 0..n * n {
            if let (Some(blur), Some(draw)) = (self.shutter.effects.motion_blur, self.shutter.draw) {
                let sample_secs = blur.offset_secs(draw, pixel, idx, n * n, tally);
                scene = self.scene(row_secs + sample_secs, tally);
            }
            let in_pixel = (DVec2::new(f64::from(idx % n), f64::from(idx / n)) + 0.5) / f64::from(n);
            if let Some(ray) = ray(&scene.moment.camera, x, y, in_pixel) {
                let sample = Sample { width_for_a_metre, index: pixel * 256 + u64::from(idx) };
                let (light, is_moving) = scene.light(&ray, sample);
                sum += light;
                n_moving += u32::from(is_moving);
            }
        }
        (sum / f64::from(n * n), n_moving > 0 && n_moving < n * n)
    }
}
