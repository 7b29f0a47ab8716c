//! Settings of effects: what a scene has for them, what a request asks, and what comes of both.

use crate::error::Fault;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Metres around a place in which something takes its light.
pub const OCCLUSION_RADIUS_M: RangeInclusive<f64> = 0.05..=20.0;
/// How much darker what is enclosed becomes.
pub const OCCLUSION_STRENGTH: RangeInclusive<f64> = 0.0..=2.0;
/// Brightness of the light, stops.
pub const EXPOSURE_STOPS: RangeInclusive<f64> = -4.0..=4.0;
/// How much of the new light is taken.
pub const RELIGHT_STRENGTH: RangeInclusive<f64> = 0.0..=1.0;
/// Where the sun stands, from north towards east, degrees.
pub const SUN_AZIMUTH_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// How high it stands, degrees.
pub const SUN_ELEVATION_DEG: RangeInclusive<f64> = -10.0..=90.0;
/// What it gives to what faces it, of what all else gives in the mean.
pub const SUN_STRENGTH: RangeInclusive<f64> = 0.0..=20.0;
/// Side of a dot, pixels of the finished picture.
pub const STIPPLE_DOT_PX: RangeInclusive<u32> = 1..=8;
/// Furthest pixel that a dot is of.
pub const STIPPLE_BLUR_PX: RangeInclusive<u32> = 1..=32;
/// Power that the grey is raised to.
pub const STIPPLE_CONTRAST: RangeInclusive<f64> = 0.25..=8.0;
/// Share of dots in what is black.
pub const STIPPLE_SHADE: RangeInclusive<f64> = 0.0..=1.0;

/// Light that is taken away where much stands around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Within [`OCCLUSION_RADIUS_M`]. Default 1.5.
    pub radius_m: f32,
    /// Within [`OCCLUSION_STRENGTH`]; 0 changes nothing. Default 1.
    pub strength: f32,
}

impl Default for Occlusion {
    fn default() -> Self {
        Self { radius_m: 1.5, strength: 1.0 }
    }
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightSource {
    /// The scene's sky, and its sun if there is one.
    Sky,
    /// A picture all around, which the scene has.
    Picture,
    /// What a camera sees of the place when nothing moves there.
    Camera,
}

impl LightSource {
    /// All of them with their words.
    pub const ALL: [(&'static str, Self); 3] =
        [("sky", Self::Sky), ("picture", Self::Picture), ("camera", Self::Camera)];

    /// Its word in requests and documents.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Sky => "sky",
            Self::Picture => "picture",
            Self::Camera => "camera",
        }
    }
}

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// From north towards east, radians. Default south.
    pub azimuth_rad: f32,
    /// Above the horizon, radians. Default half way up.
    pub elevation_rad: f32,
    /// Within [`SUN_STRENGTH`]. Default 1.
    pub strength: f32,
}

impl Sun {
    /// The unit direction towards it, in the world.
    #[must_use]
    pub fn direction(&self) -> Vec3 {
        let (up, level) = self.elevation_rad.sin_cos();
        let (east, north) = self.azimuth_rad.sin_cos();
        Vec3::new(east * level, north * level, up)
    }
}

impl Default for Sun {
    fn default() -> Self {
        Self { azimuth_rad: std::f32::consts::PI, elevation_rad: std::f32::consts::FRAC_PI_4, strength: 1.0 }
    }
}

/// Another light than that in which cameras saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relight {
    /// Where it comes from.
    pub light: LightSource,
    /// Which of the scene's cameras it is from, of [`LightSource::Camera`]; else the first that has a picture.
    pub camera_idx: Option<usize>,
    /// The sun, if there is one.
    pub sun: Option<Sun>,
    /// Within [`EXPOSURE_STOPS`]; at 0 the mean of all directions changes nothing. Default 0.
    pub exposure_stops: f32,
    /// Within [`RELIGHT_STRENGTH`]. Default 1.
    pub strength: f32,
}

impl Relight {
    /// By that light, everything else as by default.
    #[must_use]
    pub const fn by(light: LightSource) -> Self {
        Self { light, camera_idx: None, sun: None, exposure_stops: 0.0, strength: 1.0 }
    }
}

/// Dots on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stipple {
    /// Within [`STIPPLE_DOT_PX`]. Default 1.
    pub dot_px: u32,
    /// Within [`STIPPLE_BLUR_PX`]. Default 6.
    pub blur_px: u32,
    /// Within [`STIPPLE_CONTRAST`]. Default 2.
    pub contrast: f32,
    /// Within [`STIPPLE_SHADE`]; 0 leaves flat areas white, as the paper has it. Default 0.5.
    pub shade: f32,
}

impl Default for Stipple {
    fn default() -> Self {
        Self { dot_px: 1, blur_px: 6, contrast: 2.0, shade: 0.5 }
    }
}

/// Which effects a picture is to have, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EffectSettings {
    /// Ambient occlusion.
    pub occlusion: Option<Occlusion>,
    /// Another light.
    pub relight: Option<Relight>,
    /// Dots on paper.
    pub stipple: Option<Stipple>,
}

impl EffectSettings {
    /// No effect.
    pub const NONE: Self = Self { occlusion: None, relight: None, stipple: None };
}

/// What a request says of effects; what it leaves open is the scene's to say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asked {
    /// Whether there is to be occlusion.
    pub occlusion: Option<bool>,
    /// See [`Occlusion::radius_m`].
    pub occlusion_radius_m: Option<f64>,
    /// See [`Occlusion::strength`].
    pub occlusion_strength: Option<f64>,
    /// By which light; `Some(None)` by none.
    pub relight: Option<Option<LightSource>>,
    /// See [`Relight::camera_idx`]; its id.
    pub relight_camera: Option<String>,
    /// See [`Relight::exposure_stops`].
    pub relight_exposure: Option<f64>,
    /// See [`Relight::strength`].
    pub relight_strength: Option<f64>,
    /// See [`Sun::azimuth_rad`]; degrees.
    pub sun_azimuth_deg: Option<f64>,
    /// See [`Sun::elevation_rad`]; degrees.
    pub sun_elevation_deg: Option<f64>,
    /// See [`Sun::strength`].
    pub sun_strength: Option<f64>,
    /// Whether there are to be dots.
    pub stipple: Option<bool>,
    /// See [`Stipple::dot_px`].
    pub stipple_dot_px: Option<u32>,
    /// See [`Stipple::blur_px`].
    pub stipple_blur_px: Option<u32>,
    /// See [`Stipple::contrast`].
    pub stipple_contrast: Option<f64>,
    /// See [`Stipple::shade`].
    pub stipple_shade: Option<f64>,
}

impl Asked {
    /// What comes of it where the scene has `own` effects and `kept` settings for those that it does not have on;
    /// `camera_idx` finds a camera of the scene.
    ///
    /// # Errors
    /// A setting of an effect that is off, or a camera that the scene does not have: the parameter's name is the fault's place.
    pub fn over(
        &self,
        own: &EffectSettings,
        kept: &EffectSettings,
        camera_idx: impl Fn(&str) -> Option<usize>,
    ) -> Result<EffectSettings, Fault> {
        let occlusion = match (self.occlusion, own.occlusion) {
            (Some(false), _) | (None, None) => None,
            (Some(true), own) => Some(own.or(kept.occlusion).unwrap_or_default()),
            (None, own) => own,
        };
        let stipple = match (self.stipple, own.stipple) {
            (Some(false), _) | (None, None) => None,
            (Some(true), own) => Some(own.or(kept.stipple).unwrap_or_default()),
            (None, own) => own,
        };
        let relight = match (self.relight, own.relight) {
            (Some(None), _) | (None, None) => None,
            (Some(Some(light)), own) => {
                let base = own.or(kept.relight).unwrap_or(Relight::by(light));
                Some(Relight { light, ..base })
            }
            (None, own) => own,
        };
        self.check_meant(&EffectSettings { occlusion, relight, stipple })?;
        let relight = relight.map(|relight| self.relit(relight, camera_idx)).transpose()?;
        let number = |asked: Option<f64>, own: f32| asked.map_or(own, |value| value as f32);
        Ok(EffectSettings {
            occlusion: occlusion.map(|own| Occlusion {
                radius_m: number(self.occlusion_radius_m, own.radius_m),
                strength: number(self.occlusion_strength, own.strength),
            }),
            relight,
            stipple: stipple.map(|own| Stipple {
                dot_px: self.stipple_dot_px.unwrap_or(own.dot_px),
                blur_px: self.stipple_blur_px.unwrap_or(own.blur_px),
                contrast: number(self.stipple_contrast, own.contrast),
                shade: number(self.stipple_shade, own.shade),
            }),
        })
    }

    fn relit(&self, own: Relight, camera_idx: impl Fn(&str) -> Option<usize>) -> Result<Relight, Fault> {
        let camera_idx = match &self.relight_camera {
            Some(id) => Some(camera_idx(id).ok_or_else(|| {
                Fault::new("relight_camera", format!("the scene has no camera {id:?} that may be seen"))
            })?),
            None => own.camera_idx,
        };
        let number = |asked: Option<f64>, own: f32| asked.map_or(own, |value| value as f32);
        let is_sunny = own.sun.is_some()
            || self.sun_azimuth_deg.is_some()
            || self.sun_elevation_deg.is_some()
            || self.sun_strength.is_some();
        let sun = own.sun.unwrap_or_default();
        let sun = Sun {
            azimuth_rad: number(self.sun_azimuth_deg.map(f64::to_radians), sun.azimuth_rad),
            elevation_rad: number(self.sun_elevation_deg.map(f64::to_radians), sun.elevation_rad),
            strength: number(self.sun_strength, sun.strength),
        };
        Ok(Relight {
            light: own.light,
            camera_idx,
            sun: is_sunny.then_some(sun),
            exposure_stops: number(self.relight_exposure, own.exposure_stops),
            strength: number(self.relight_strength, own.strength),
        })
    }

    /// Refuses settings of what is off.
    fn check_meant(&self, on: &EffectSettings) -> Result<(), Fault> {
        let is_camera = on.relight.is_some_and(|relight| relight.light == LightSource::Camera);
        let (has_occlusion, is_relit, has_stipple) =
            (on.occlusion.is_some(), on.relight.is_some(), on.stipple.is_some());
        let lit = "relight=sky, relight=picture and relight=camera";
        let given = [
            ("occlusion_radius", self.occlusion_radius_m.is_some(), has_occlusion, "occlusion=on"),
            ("occlusion_strength", self.occlusion_strength.is_some(), has_occlusion, "occlusion=on"),
            ("relight_camera", self.relight_camera.is_some(), is_camera, "relight=camera"),
            ("relight_exposure", self.relight_exposure.is_some(), is_relit, lit),
            ("relight_strength", self.relight_strength.is_some(), is_relit, lit),
            ("sun_azimuth", self.sun_azimuth_deg.is_some(), is_relit, lit),
            ("sun_elevation", self.sun_elevation_deg.is_some(), is_relit, lit),
            ("sun_strength", self.sun_strength.is_some(), is_relit, lit),
            ("stipple_dot", self.stipple_dot_px.is_some(), has_stipple, "stipple=on"),
            ("stipple_blur", self.stipple_blur_px.is_some(), has_stipple, "stipple=on"),
            ("stipple_contrast", self.stipple_contrast.is_some(), has_stipple, "stipple=on"),
            ("stipple_shade", self.stipple_shade.is_some(), has_stipple, "stipple=on"),
        ];
        match given.into_iter().find(|(_, is_given, is_meant, _)| *is_given && !*is_meant) {
            Some((parameter, .., with)) => {
                Err(Fault::new(parameter, format!("means something with {with} alone")))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_camera(_: &str) -> Option<usize> {
        None
    }

    #[test]
    fn nothing_is_on_unless_scene_or_request_ask_for_it() {
        let none = EffectSettings::NONE;
        assert_eq!(Asked::default().over(&none, &none, no_camera), Ok(none));
        let own = EffectSettings { occlusion: Some(Occlusion { radius_m: 3.0, strength: 0.5 }), ..none };
        assert_eq!(Asked::default().over(&own, &none, no_camera), Ok(own));
        let off = Asked { occlusion: Some(false), ..Asked::default() };
        assert_eq!(off.over(&own, &none, no_camera), Ok(none));
        let on = Asked { occlusion: Some(true), occlusion_radius_m: Some(0.5), ..Asked::default() };
        let found = on.over(&none, &own, no_camera).expect("settings");
        assert_eq!(found.occlusion, Some(Occlusion { radius_m: 0.5, strength: 0.5 }), "the scene's strength");
    }

    #[test]
    fn a_setting_of_what_is_off_is_refused_by_its_name() {
        let none = EffectSettings::NONE;
        let check = |asked: Asked, place: &str| {
            let fault = asked.over(&none, &none, no_camera).expect_err(place);
            assert_eq!(fault.place, place, "{fault}");
        };
        check(Asked { occlusion_radius_m: Some(1.0), ..Asked::default() }, "occlusion_radius");
        check(Asked { sun_elevation_deg: Some(1.0), ..Asked::default() }, "sun_elevation");
        check(Asked { stipple_dot_px: Some(1), ..Asked::default() }, "stipple_dot");
        let lit = Asked { relight: Some(Some(LightSource::Sky)), ..Asked::default() };
        check(Asked { relight_camera: Some("west".to_owned()), ..lit.clone() }, "relight_camera");
        let by_camera = Asked {
            relight: Some(Some(LightSource::Camera)),
            relight_camera: Some("west".to_owned()),
            ..lit.clone()
        };
        check(by_camera.clone(), "relight_camera");
        let found = by_camera.over(&none, &none, |id| (id == "west").then_some(3)).expect("settings");
        assert_eq!(found.relight.and_then(|relight| relight.camera_idx), Some(3));
        let sunny = Asked { sun_elevation_deg: Some(30.0), ..lit };
        let sun = sunny.over(&none, &none, no_camera).expect("settings").relight.and_then(|of| of.sun);
        assert_eq!(sun, Some(Sun { elevation_rad: 30_f64.to_radians() as f32, ..Sun::default() }));
    }
}
