//! What is to be done to a picture once the scene is drawn: parameters of every view.

use super::parameters::{Parameter, words};
use super::query::Query;
use std::ops::RangeInclusive;
use videofields_vision::effects::{
    Asked, EXPOSURE_STOPS, LightSource, OCCLUSION_RADIUS_M, OCCLUSION_STRENGTH, RELIGHT_STRENGTH,
    STIPPLE_BLUR_PX, STIPPLE_CONTRAST, STIPPLE_DOT_PX, STIPPLE_SHADE, SUN_AZIMUTH_DEG, SUN_ELEVATION_DEG,
    SUN_STRENGTH,
};

/// By which light, or by none.
const LIGHTS: [(&str, Option<LightSource>); 4] = [
    ("off", None),
    (LightSource::ALL[0].0, Some(LightSource::Sky)),
    (LightSource::ALL[1].0, Some(LightSource::Picture)),
    (LightSource::ALL[2].0, Some(LightSource::Camera)),
];

const SWITCH: [(&str, bool); 2] = [("on", true), ("off", false)];

const DOT_PX: RangeInclusive<u64> = *STIPPLE_DOT_PX.start() as u64..=*STIPPLE_DOT_PX.end() as u64;
const BLUR_PX: RangeInclusive<u64> = *STIPPLE_BLUR_PX.start() as u64..=*STIPPLE_BLUR_PX.end() as u64;

/// The parameters that are read here. What holds where one is left out is the scene's to say; in most nothing.
pub(super) const PARAMETERS: [Parameter; 15] = [
    Parameter::word(
        "occlusion",
        || words(&SWITCH),
        "Whether light is taken away where much stands around; the scene's if absent",
    ),
    Parameter::number("occlusion_radius", &OCCLUSION_RADIUS_M, "Within how many metres; of `occlusion=on`"),
    Parameter::number("occlusion_strength", &OCCLUSION_STRENGTH, "How much; of `occlusion=on`"),
    Parameter::word(
        "relight",
        || words(&LIGHTS),
        "In which light the scene is shown: its sky's, a picture's that it has, a camera's background's; the scene's if absent",
    ),
    Parameter::id("relight_camera", "The camera whose background is the light; of `relight=camera`"),
    Parameter::number("relight_exposure", &EXPOSURE_STOPS, "How bright the light is, stops; of `relight`"),
    Parameter::number("relight_strength", &RELIGHT_STRENGTH, "How much of it is taken; of `relight`"),
    Parameter::number("sun_azimuth", &SUN_AZIMUTH_DEG, "Adds a sun, degrees from north; of `relight`"),
    Parameter::number("sun_elevation", &SUN_ELEVATION_DEG, "Adds a sun, degrees high; of `relight`"),
    Parameter::number(
        "sun_strength",
        &SUN_STRENGTH,
        "Adds a sun: what it gives to what faces it, of what all else gives in the mean; of `relight`",
    ),
    Parameter::word(
        "stipple",
        || words(&SWITCH),
        "Whether the picture is drawn as dots on paper; the scene's if absent",
    ),
    Parameter::whole("stipple_dot", &DOT_PX, "Side of a dot, pixels; of `stipple=on`"),
    Parameter::whole("stipple_blur", &BLUR_PX, "How far away a dot's pixel may lie; of `stipple=on`"),
    Parameter::number("stipple_contrast", &STIPPLE_CONTRAST, "Power of the grey; of `stipple=on`"),
    Parameter::number("stipple_shade", &STIPPLE_SHADE, "Share of dots in what is black; of `stipple=on`"),
];

/// What a query says of effects.
pub(super) fn read(query: &mut Query) -> Asked {
    Asked {
        occlusion: query.choice("occlusion", &SWITCH),
        occlusion_radius_m: query.number("occlusion_radius", &OCCLUSION_RADIUS_M, " metres"),
        occlusion_strength: query.number("occlusion_strength", &OCCLUSION_STRENGTH, ""),
        relight: query.choice("relight", &LIGHTS),
        relight_camera: query.id("relight_camera"),
        relight_exposure: query.number("relight_exposure", &EXPOSURE_STOPS, " stops"),
        relight_strength: query.number("relight_strength", &RELIGHT_STRENGTH, ""),
        sun_azimuth_deg: query.number("sun_azimuth", &SUN_AZIMUTH_DEG, " degrees"),
        sun_elevation_deg: query.number("sun_elevation", &SUN_ELEVATION_DEG, " degrees"),
        sun_strength: query.number("sun_strength", &SUN_STRENGTH, ""),
        stipple: query.choice("stipple", &SWITCH),
        stipple_dot_px: query.whole("stipple_dot", &STIPPLE_DOT_PX),
        stipple_blur_px: query.whole("stipple_blur", &STIPPLE_BLUR_PX),
        stipple_contrast: query.number("stipple_contrast", &STIPPLE_CONTRAST, ""),
        stipple_shade: query.number("stipple_shade", &STIPPLE_SHADE, ""),
    }
}
