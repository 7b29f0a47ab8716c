//! What may be done to a picture of a scene once it is drawn: which effects there are, their settings, and the arithmetic of each.
//!
//! In: a scene's defaults and a request's wishes. Out: settings within their ranges. The functions of a pixel are in f32 and one
//! pixel at a time: they are what the shaders of `render` are held to. Must not know scenes, cameras' frames, plans or the GPU.

mod distances;
mod harmonics;
mod occlusion;
mod relight;
mod settings;
mod stipple;

pub use distances::{Distances, Lens, NOTHING_M};
pub use harmonics::{Harmonics, LightError, N_HARMONICS, basis};
pub use occlusion::{BLUR_PX, N_ROTATIONS, N_TAPS, open_share, rotations, smoothed, taps};
pub use relight::{MATT_BANDS, MEAN_CODE, MattLight, relit};
pub use settings::{
    Asked, EXPOSURE_STOPS, EffectSettings, LightSource, OCCLUSION_RADIUS_M, OCCLUSION_STRENGTH, Occlusion,
    RELIGHT_STRENGTH, Relight, STIPPLE_BLUR_PX, STIPPLE_CONTRAST, STIPPLE_DOT_PX, STIPPLE_SHADE,
    SUN_AZIMUTH_DEG, SUN_ELEVATION_DEG, SUN_STRENGTH, Stipple, Sun,
};
pub use stipple::{dot_of, partner, stippled};
