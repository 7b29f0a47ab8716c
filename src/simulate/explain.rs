//! What a world calls for: every effect on or off, why, and what each named one costs here, measured.
//!
//! A world goes in; an [`Explanation`] comes out. A cost is the difference between frames of the world as it is and of
//! the same world without that effect: cast, sensor, delivery and codec together.

use super::SimulateError;
use super::delivery::deliver;
use super::effects::{Draw, EffectKind, EffectStage, Effects};
use super::station::{Station, Wanted};
use super::video::{Codec, VideoWriter};
use super::world::World;
use super::write::send;
use serde::Serialize;
use videofields_vision::clock::Clock;
use videofields_vision::geometry::{Camera, Distortion};

/// How it is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplainOptions {
    /// Columns and rows of the pictures. Default: each camera's own.
    pub size_px: Option<(u32, u32)>,
    /// Samples a pixel, each way, 1 to 16. Default 3.
    pub samples_per_side: u32,
    /// Frames a second. Default: each camera's own.
    pub rate_hz: Option<f64>,
    /// Frames of each measurement, 1 to 1000. Default 3.
    pub n_frames: u64,
    /// How often everything is measured, 1 to 100; the least time of each counts. Default 2.
    pub n_rounds: u32,
    /// Which effects are measured beside those that the world names. Default: none.
    pub beside: Beside,
}

impl Default for ExplainOptions {
    fn default() -> Self {
        Self {
            size_px: None,
            samples_per_side: 3,
            rate_hz: None,
            n_frames: 3,
            n_rounds: 2,
            beside: Beside::Nothing,
        }
    }
}

/// Which effects are measured beside those that a world names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Beside {
    /// None.
    #[default]
    Nothing,
    /// Every effect alone and all together, each with the world's settings or else its defaults.
    Everything,
}

/// What a world calls for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// The world's id.
    pub world: String,
    /// The camera whose frames were measured.
    pub camera: String,
    /// Columns and rows of its pictures.
    pub size_px: (u32, u32),
    /// Samples a pixel, each way.
    pub samples_per_side: u32,
    /// Threads that cast.
    pub n_threads: usize,
    /// How often the still world is cast.
    pub still_world: StillWorld,
    /// Every effect, in the order in which they work.
    pub effects: Vec<EffectLine>,
    /// Lenses that distort; part of the cameras' calibrations.
    pub lens_distortion: LensLine,
    /// Milliseconds of a frame with everything that is named.
    pub frame_ms: f64,
    /// Milliseconds of a frame of the same world with no effect.
    pub bare_frame_ms: f64,
    /// Milliseconds of a frame of the same world with every effect, where that was asked for.
    pub full_frame_ms: Option<f64>,
}

/// How often the still world is cast.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillWorld {
    /// Once for all frames of a camera, or for every frame.
    pub is_cast_once: bool,
    /// Why.
    pub reason: String,
    /// Milliseconds of one camera's still world.
    pub cost_ms: f64,
}

/// One effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectLine {
    /// Its name.
    pub id: &'static str,
    /// Where it works.
    pub stage: EffectStage,
    /// Whether it runs.
    pub is_on: bool,
    /// Why it does or does not.
    pub reason: String,
    /// Its settings, if it is named.
    pub settings: Option<serde_json::Value>,
    /// Milliseconds that it adds to a frame, if it is named; what is too small to measure may come out negative.
    pub cost_ms: Option<f64>,
    /// Milliseconds that it adds to a frame of the same world with no other effect, where that was asked for.
    pub cost_alone_ms: Option<f64>,
}

/// Lens distortion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensLine {
    /// Whether a camera's lens distorts.
    pub is_on: bool,
    /// Which cameras' lenses do.
    pub cameras: Vec<String>,
    /// Milliseconds that it adds to the still world of the first of these, if there is one.
    pub cost_ms: Option<f64>,
}

/// Says what `world` calls for, and measures it on this machine; `progress` is told how many of how many measurements
/// are done.
///
/// # Errors
/// When an option is out of its range, or a part of GStreamer is missing.
pub fn explain(
    world: &World,
    options: &ExplainOptions,
    clock: &dyn Clock,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Explanation, SimulateError> {
    let cameras = world.cameras_at(options.size_px)?;
    let Some((id, camera)) = cameras.first() else {
        return Err(SimulateError::View { field: "world", allowed: "one with a camera" });
    };
    let range = |field, allowed| Err(SimulateError::View { field, allowed });
    if !(1..=1000).contains(&options.n_frames) || !(1..=100).contains(&options.n_rounds) {
        return range("number of measured frames or rounds", "1 to 1000 frames and 1 to 100 rounds");
    }
    let own_rate_hz = world.camera_settings().next().map_or(10.0, |setting| setting.rate_hz);
    let rate_hz = options.rate_hz.unwrap_or(own_rate_hz);
    if !(0.1..=240.0).contains(&rate_hz) {
        return range("rate", "0.1 to 240 frames a second");
    }
    let named: Vec<EffectKind> = world.effects().named().collect();
    let variants = variants(world, &named, options.beside);
    let mut meter = Meter { options, clock, id, camera, rate_hz };
    let mut least_ms = vec![f64::INFINITY; variants.len()];
    let n_steps = variants.len() * options.n_rounds as usize + 1;
    for round in 0..options.n_rounds as usize {
        for (i, variant) in variants.iter().enumerate() {
            least_ms[i] = least_ms[i].min(meter.frame_ms(variant)?);
            progress(round * variants.len() + i + 1, n_steps);
        }
    }
    let still_world = StillWorld { cost_ms: meter.still_ms(world)?, ..still_world(world) };
    let lens_distortion = meter.lens(world, &cameras)?;
    progress(n_steps, n_steps);
    let settings = serde_json::to_value(world.effects())?;
    let beside = &least_ms[2 + named.len()..];
    let line = |kind: EffectKind| {
        let place = named.iter().position(|other| *other == kind);
        EffectLine {
            id: kind.id(),
            stage: kind.stage(),
            is_on: place.is_some(),
            reason: if place.is_some() { "the world names it" } else { "not named" }.to_owned(),
            settings: settings.get(kind.key()).cloned(),
            cost_ms: place.map(|place| least_ms[0] - least_ms[2 + place]),
            // The last ones: every effect alone, then all.
            cost_alone_ms: beside.get(kind as usize).map(|alone_ms| alone_ms - least_ms[1]),
        }
    };
    Ok(Explanation {
        world: world.id().to_owned(),
        camera: (*id).to_string(),
        size_px: camera.size_px(),
        samples_per_side: options.samples_per_side,
        n_threads: rayon::current_num_threads(),
        still_world,
        effects: EffectKind::ALL.into_iter().map(line).collect(),
        lens_distortion,
        frame_ms: least_ms[0],
        bare_frame_ms: least_ms[1],
        full_frame_ms: beside.last().copied(),
    })
}

/// The worlds that are measured: as it is, without effects, without each that it names; and, if asked for, with each
/// effect alone and with all.
fn variants(world: &World, named: &[EffectKind], beside: Beside) -> Vec<World> {
    let own = world.effects();
    let bare = EffectKind::ALL.into_iter().fold(own.clone(), Effects::without);
    let mut all = vec![own.clone(), bare];
    all.extend(named.iter().map(|kind| own.clone().without(*kind)));
    if beside == Beside::Everything {
        let full = EffectKind::ALL.into_iter().fold(own.clone(), Effects::with);
        let alone = |kind: EffectKind| {
            EffectKind::ALL.into_iter().filter(|other| *other != kind).fold(full.clone(), Effects::without)
        };
        all.extend(EffectKind::ALL.into_iter().map(alone));
        all.push(full);
    }
    all.into_iter().map(|effects| world.with_effects(effects)).collect()
}

/// How often a world's effects let its still part be cast, and why; not what it costs.
fn still_world(world: &World) -> StillWorld {
    let changes_it = |kind: &EffectKind| {
        let others = EffectKind::ALL.into_iter().filter(|other| other != kind);
        let alone = others.fold(world.effects().clone(), Effects::without);
        !world.with_effects(alone).plates_last_for_cameras()
    };
    let changing: Vec<&str> = world.effects().named().filter(changes_it).map(EffectKind::id).collect();
    let reason = match &changing[..] {
        [] => "nothing named changes it between frames".to_owned(),
        [one] => format!("{one} changes it between frames"),
        many => format!("{} change it between frames", many.join(", ")),
    };
    StillWorld { is_cast_once: world.plates_last_for_cameras(), reason, cost_ms: 0.0 }
}

/// Measures frames of one camera.
struct Meter<'a> {
    options: &'a ExplainOptions,
    clock: &'a dyn Clock,
    id: &'a str,
    camera: &'a Camera,
    rate_hz: f64,
}

impl Meter<'_> {
    /// Milliseconds of a frame, from the world to the encoded picture; without the still world where that is cast once.
    fn frame_ms(&mut self, world: &World) -> Result<f64, SimulateError> {
        let ExplainOptions { samples_per_side, n_frames, .. } = *self.options;
        let rate_hz = self.rate_hz;
        let (effects, entries) = (world.effects(), world.entries());
        let mut station =
            Station::new(world, self.id, self.camera, samples_per_side, rate_hz, Wanted::Picture)?;
        let draw = Draw::of_camera(effects.seed, self.id);
        let mut video = VideoWriter::nowhere(self.camera.size_px(), rate_hz, &Codec::of(effects, entries))?;
        let start = self.clock.monotonic();
        let arrivals = deliver(effects, draw, n_frames, rate_hz, entries).arrivals;
        for frame in 0..n_frames {
            let time_secs = frame as f64 / rate_hz;
            let shot = station.shoot(frame, time_secs, Wanted::Picture)?;
            for arrival in arrivals.iter().filter(|arrival| arrival.frame == frame) {
                send(world, &mut video, draw, arrival, shot.picture(), rate_hz)?;
            }
        }
        video.finish()?;
        Ok((self.clock.monotonic() - start).as_secs_f64() * 1e3 / n_frames as f64)
    }

    /// Milliseconds of the still world.
    fn still_ms(&self, world: &World) -> Result<f64, SimulateError> {
        self.still_ms_of(world, self.camera)
    }

    fn still_ms_of(&self, world: &World, camera: &Camera) -> Result<f64, SimulateError> {
        let mut least = f64::INFINITY;
        for _ in 0..self.options.n_rounds {
            let start = self.clock.monotonic();
            world.plate(camera, self.options.samples_per_side)?;
            least = least.min((self.clock.monotonic() - start).as_secs_f64() * 1e3);
        }
        Ok(least)
    }

    /// Which lenses distort, and what one of them costs.
    fn lens(&self, world: &World, cameras: &[(impl ToString, Camera)]) -> Result<LensLine, SimulateError> {
        let distorting: Vec<&(_, Camera)> =
            cameras.iter().filter(|(_, camera)| !matches!(camera.distortion(), Distortion::None)).collect();
        let cost_ms = match distorting.first() {
            Some((_, camera)) => {
                let straight = Camera::new(
                    camera.size_px(),
                    camera.focal_px(),
                    camera.center_px(),
                    Distortion::None,
                    *camera.pose(),
                )?;
                Some(self.still_ms_of(world, camera)? - self.still_ms_of(world, &straight)?)
            }
            None => None,
        };
        let cameras = distorting.iter().map(|(id, _)| id.to_string()).collect::<Vec<_>>();
        Ok(LensLine { is_on: !cameras.is_empty(), cameras, cost_ms })
    }
}

#[cfg(test)]
mod tests {
    use super::super::effects::{CastShadows, Noise};
    use super::*;
    use videofields_vision::clock::SystemClock;

    #[test]
    fn the_plaza_says_what_it_names_and_why() {
        let world = World::plaza();
        let options = ExplainOptions {
            size_px: Some((64, 36)),
            samples_per_side: 1,
            n_frames: 1,
            n_rounds: 1,
            ..ExplainOptions::default()
        };
        let mut steps = Vec::new();
        let told = explain(&world, &options, &SystemClock::new(), &mut |done, all| steps.push((done, all)))
            .expect("it can be measured");
        assert!(told.still_world.is_cast_once && told.still_world.cost_ms > 0.0);
        assert_eq!(told.effects.len(), EffectKind::ALL.len());
        let on: Vec<_> = told.effects.iter().filter(|line| line.is_on).collect();
        assert_eq!(on.len(), 1);
        assert_eq!((on[0].id, on[0].reason.as_str()), ("cast-shadows", "the world names it"));
        assert_eq!(on[0].settings, Some(serde_json::to_value(CastShadows::STILL).expect("plain data")));
        assert!(told.effects.iter().all(|line| line.cost_ms.is_some() == line.is_on));
        assert_eq!(told.lens_distortion.cameras, ["north"]);
        assert!(told.frame_ms > 0.0 && told.bare_frame_ms > 0.0);
        assert!(told.full_frame_ms.is_none() && told.effects.iter().all(|line| line.cost_alone_ms.is_none()));
        assert_eq!(steps.last(), Some(&(4, 4)));
    }

    #[test]
    fn every_effect_alone_and_all_together_are_measured_if_asked_for() {
        let named = [EffectKind::CastShadows];
        let variants = variants(&World::plaza(), &named, Beside::Everything);
        let names: Vec<Vec<EffectKind>> =
            variants.iter().map(|world| world.effects().named().collect()).collect();
        assert_eq!(names[..3], [named.to_vec(), Vec::new(), Vec::new()]);
        for (name, kind) in names[3..].iter().zip(EffectKind::ALL) {
            assert_eq!(*name, [kind]);
        }
        assert_eq!(names[3 + EffectKind::ALL.len()..], [EffectKind::ALL.to_vec()]);
        // The world's own settings are kept.
        assert_eq!(variants[3 + 2].effects().cast_shadows, Some(CastShadows::STILL));
        let options = ExplainOptions {
            size_px: Some((32, 18)),
            samples_per_side: 1,
            n_frames: 1,
            n_rounds: 1,
            beside: Beside::Everything,
            ..ExplainOptions::default()
        };
        let told = explain(&World::plaza(), &options, &SystemClock::new(), &mut |_, _| ()).expect("measured");
        assert!(told.full_frame_ms.is_some_and(|full_ms| full_ms > 0.0));
        assert!(told.effects.iter().all(|line| line.cost_alone_ms.is_some()));
    }

    #[test]
    fn what_changes_the_still_world_is_named() {
        let noisy = Effects { noise: Some(Noise::default()), ..Effects::default() };
        let of = |effects| still_world(&World::plaza().with_effects(effects));
        assert!(of(noisy.clone()).is_cast_once);
        let told = of(noisy.with(EffectKind::LightDrift).with(EffectKind::CameraShake));
        assert!(!told.is_cast_once);
        assert_eq!(told.reason, "light-drift, camera-shake change it between frames");
    }
}
