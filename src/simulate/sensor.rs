//! A camera's sensor: from the light that falls on it to the 8-bit codes that it gives.
//!
//! Weather, exposure and noise work on the linear picture in this order, each only if it is named; a sensor without
//! effects is never asked. Owns what a camera remembers from frame to frame (its exposure).

use super::effects::{Draw, Effects, Entries, ExposureState};
use super::world::srgb_code;
use glam::DVec3;
use rayon::prelude::*;
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::Camera;

/// What falls on the sensor during one frame.
pub(super) struct Exposed<'a> {
    /// Linear light, row by row; it is used up.
    pub(super) linear: Vec<[f32; 3]>,
    /// Depth along the axis, metres; 0 where it is the sky.
    pub(super) depth_m: &'a [f32],
    /// Number of the frame and its time.
    pub(super) frame: u64,
    pub(super) time_secs: f64,
    /// Light of the sky at that time.
    pub(super) sky: DVec3,
}

/// One camera's sensor.
pub(super) struct Sensor<'a> {
    effects: &'a Effects,
    entries: &'a Entries,
    draw: Draw,
    exposure: ExposureState,
    interval_secs: f64,
}

impl<'a> Sensor<'a> {
    /// The sensor of the camera whose draw is given, at frames `interval_secs` apart; none where no effect of sensors
    /// is named, for then the picture as it was cast is what it gives.
    pub(super) fn new(
        effects: &'a Effects,
        entries: &'a Entries,
        draw: Draw,
        interval_secs: f64,
    ) -> Option<Self> {
        let Effects { rain, snow, exposure, noise, .. } = effects;
        let is_named = rain.is_some() || snow.is_some() || exposure.is_some() || noise.is_some();
        is_named.then(|| Self { effects, entries, draw, exposure: ExposureState::default(), interval_secs })
    }

    /// The picture that the sensor gives of what falls on it; frames must come in their order.
    pub(super) fn develop(&mut self, camera: &Camera, exposed: Exposed<'_>) -> RgbImage {
        let Exposed { mut linear, depth_m, frame, time_secs, sky } = exposed;
        let tally = self.entries.tally();
        let open_secs = self.effects.motion_blur.as_ref().map(|blur| blur.open_secs.max(1e-4));
        if let Some(mut rain) = self.effects.rain {
            rain.exposure_secs = open_secs.unwrap_or(rain.exposure_secs);
            rain.fall(&mut linear, depth_m, camera, sky, self.draw.at_frame(frame), &tally);
        }
        if let Some(mut snow) = self.effects.snow {
            snow.exposure_secs = open_secs.unwrap_or(snow.exposure_secs);
            snow.fall(&mut linear, depth_m, camera, sky, self.draw, time_secs, &tally);
        }
        let gain = self.effects.exposure.as_ref().map_or(1.0, |exposure| {
            exposure.expose(&mut linear, &mut self.exposure, self.interval_secs, &tally)
        });
        if let Some(noise) = &self.effects.noise {
            noise.disturb(&mut linear, gain, self.draw, frame, &tally);
        }
        codes(&linear, camera.size_px())
    }
}

/// The 8-bit sRGB picture of linear light.
fn codes(linear: &[[f32; 3]], (width, height): (u32, u32)) -> RgbImage {
    let mut data = vec![0; linear.len() * 3];
    data.par_chunks_mut(3 * 1024).zip(linear.par_chunks(1024)).for_each(|(codes, pixels)| {
        for (code, value) in codes.iter_mut().zip(pixels.as_flattened()) {
            *code = srgb_code(f64::from(*value));
        }
    });
    RgbImage { width, height, data }
}

#[cfg(test)]
mod tests {
    use super::super::effects::{EffectKind, Noise};
    use super::*;

    fn camera() -> Camera {
        Camera::pinhole(DVec3::new(0.0, 0.0, 4.0), DVec3::new(9.0, 0.0, 2.0), 0.7, (64, 36))
            .expect("a camera")
    }

    fn exposed(depth_m: &[f32], frame: u64) -> Exposed<'_> {
        let sky = DVec3::splat(0.6);
        Exposed { linear: vec![[0.2; 3]; 64 * 36], depth_m, frame, time_secs: frame as f64 * 0.1, sky }
    }

    #[test]
    fn a_sensor_without_effects_is_none() {
        let entries = Entries::default();
        let draw = Draw::of_camera(0, "a");
        for kind in EffectKind::ALL {
            let is_of_sensor = Sensor::new(&Effects::default().with(kind), &entries, draw, 0.1).is_some();
            assert_eq!(
                is_of_sensor,
                kind.stage() == super::super::effects::EffectStage::Sensor,
                "{}",
                kind.id()
            );
        }
    }

    #[test]
    fn each_effect_changes_the_picture_and_enters_no_other() {
        let depth = vec![20.0; 64 * 36];
        for kind in [EffectKind::Rain, EffectKind::Snow, EffectKind::Exposure, EffectKind::Noise] {
            let entries = Entries::default();
            let mut effects = Effects::default().with(kind);
            if let Some(exposure) = &mut effects.exposure {
                exposure.target = 0.4;
            }
            let draw = Draw::of_camera(0, "a");
            let mut sensor = Sensor::new(&effects, &entries, draw, 0.1).expect("an effect is named");
            let plain = codes(&exposed(&depth, 0).linear, (64, 36));
            assert_ne!(sensor.develop(&camera(), exposed(&depth, 0)), plain, "{}", kind.id());
            for other in EffectKind::ALL {
                assert_eq!(entries.count(other) > 0, other == kind, "{} in {}", other.id(), kind.id());
            }
        }
    }

    #[test]
    fn the_same_frame_has_the_same_noise_whoever_is_asked_before() {
        let depth = vec![20.0; 64 * 36];
        let effects = Effects { noise: Some(Noise::default()), ..Effects::default() };
        let entries = Entries::default();
        let draw = Draw::of_camera(0, "a");
        let sensor = || Sensor::new(&effects, &entries, draw, 0.1).expect("noise is named");
        let (mut one, mut other) = (sensor(), sensor());
        let _first = one.develop(&camera(), exposed(&depth, 0));
        let second = one.develop(&camera(), exposed(&depth, 1));
        assert_eq!(second, other.develop(&camera(), exposed(&depth, 1)));
        assert_ne!(second, other.develop(&camera(), exposed(&depth, 2)));
    }
}
