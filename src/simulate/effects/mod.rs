//! What a world simulates beyond plain shading, each effect only if it is named.
//!
//! ```text
//! light_drift, light_switching ─▶ gains of sun, sky and lamps at a time ┐
//! cast_shadows                 ─▶ directions towards the sun            ├─▶ `cast` asks while it casts
//! wet_ground                   ─▶ puddles, Fresnel, mirrored rays       │
//! foliage_motion, camera_shake ─▶ sway of a crown, pose of a camera     │
//! motion_blur, rolling_shutter ─▶ when a sample of a row looks          ┘
//! rain, snow, exposure, noise  ─▶ the linear picture to 8-bit codes        `sensor` calls in this order
//! compression                  ─▶ settings of the codec                 ┐
//! clock, jitter, late, drop, duplicate, corrupt ─▶ what arrives, when   ┘  `delivery` calls
//! ```
//!
//! Every effect is a file of one anatomy: settings with documented ranges, pure functions of (settings, [`Draw`],
//! time or place), tests. An effect that is absent is never entered: callers match on its `Option`, and every
//! function notes its entry in a [`Tally`]. Knows nothing of worlds and how they are cast.

mod camera_shake;
mod cast_shadows;
mod clock;
mod compression;
mod corrupt;
mod draw;
mod drop;
mod duplicate;
mod entries;
mod exposure;
mod foliage_motion;
mod jitter;
mod late;
mod light_drift;
mod light_switching;
mod motion_blur;
mod noise;
mod rain;
mod ranges;
mod rolling_shutter;
mod snow;
mod streak;
mod wet_ground;

pub use camera_shake::CameraShake;
pub use cast_shadows::{CastShadows, Casters};
pub use clock::{Clock, ClockError};
pub use compression::Compression;
pub use corrupt::{Corrupt, Damage};
pub use draw::Draw;
pub use drop::Drop;
pub use duplicate::Duplicate;
pub use entries::{Entries, Tally};
pub use exposure::{Exposure, ExposureState};
pub use foliage_motion::FoliageMotion;
pub use jitter::Jitter;
pub use late::Late;
pub use light_drift::LightDrift;
pub use light_switching::{LightSwitching, SwitchedLights};
pub use motion_blur::MotionBlur;
pub use noise::Noise;
pub use rain::Rain;
pub use rolling_shutter::RollingShutter;
pub use snow::Snow;
pub use wet_ground::{WetGround, Wetness};

use glam::DVec3;
use ranges::Ranges;
use serde::{Deserialize, Serialize};
use videofields_vision::error::Fault;

/// The effects that a world names, with their settings; an absent one does not run.
///
/// In a document `{}` names an effect with its defaults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Effects {
    /// What all randomness hangs on; another seed gives other noise, drops, lost frames. Default 0.
    pub seed: u64,
    /// Slow change of sun and sky.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_drift: Option<LightDrift>,
    /// Lights that go on and off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_switching: Option<LightSwitching>,
    /// Shadows from the sun and lamps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cast_shadows: Option<CastShadows>,
    /// Puddles that mirror.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wet_ground: Option<WetGround>,
    /// Crowns and bushes that sway.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub foliage_motion: Option<FoliageMotion>,
    /// Cameras that sway on their poles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_shake: Option<CameraShake>,
    /// Light gathered for a time, not an instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion_blur: Option<MotionBlur>,
    /// Rows read one after the other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rolling_shutter: Option<RollingShutter>,
    /// Falling drops in front of everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rain: Option<Rain>,
    /// Falling flakes in front of everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snow: Option<Snow>,
    /// The camera's own control of its brightness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<Exposure>,
    /// The sensor's noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
    /// A codec with little to spend.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compression: Option<Compression>,
    /// Frames that are lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop: Option<Drop>,
    /// Frames that arrive late.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub late: Option<Late>,
    /// Frames that arrive twice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duplicate: Option<Duplicate>,
    /// Frames that arrive damaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrupt: Option<Corrupt>,
    /// Cameras whose clocks are wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// A network whose delay varies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter: Option<Jitter>,
}

/// The name of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "each is the field of `Effects` of the same name, which is documented")]
pub enum EffectKind {
    LightDrift,
    LightSwitching,
    CastShadows,
    WetGround,
    FoliageMotion,
    CameraShake,
    MotionBlur,
    RollingShutter,
    Rain,
    Snow,
    Exposure,
    Noise,
    Compression,
    Drop,
    Late,
    Duplicate,
    Corrupt,
    Clock,
    Jitter,
}

/// Where in the making of a frame an effect works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EffectStage {
    /// Changes rays or light.
    Scene,
    /// Changes the picture that the sensor gives.
    Sensor,
    /// Changes what arrives, and when.
    Delivery,
}

impl EffectKind {
    /// All effects, in the order in which they work.
    pub const ALL: [Self; 19] = [
        Self::LightDrift,
        Self::LightSwitching,
        Self::CastShadows,
        Self::WetGround,
        Self::FoliageMotion,
        Self::CameraShake,
        Self::MotionBlur,
        Self::RollingShutter,
        Self::Rain,
        Self::Snow,
        Self::Exposure,
        Self::Noise,
        Self::Compression,
        Self::Drop,
        Self::Late,
        Self::Duplicate,
        Self::Corrupt,
        Self::Clock,
        Self::Jitter,
    ];

    /// Its name for people and file names, such as `light-drift`.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::LightDrift => "light-drift",
            Self::LightSwitching => "light-switching",
            Self::CastShadows => "cast-shadows",
            Self::WetGround => "wet-ground",
            Self::FoliageMotion => "foliage-motion",
            Self::CameraShake => "camera-shake",
            Self::MotionBlur => "motion-blur",
            Self::RollingShutter => "rolling-shutter",
            Self::Rain => "rain",
            Self::Snow => "snow",
            Self::Exposure => "exposure",
            Self::Noise => "noise",
            Self::Compression => "compression",
            Self::Drop => "drop",
            Self::Late => "late",
            Self::Duplicate => "duplicate",
            Self::Corrupt => "corrupt",
            Self::Clock => "clock",
            Self::Jitter => "jitter",
        }
    }

    /// Its key in a world's `effects`, such as `light_drift`.
    #[must_use]
    pub fn key(self) -> String {
        self.id().replace('-', "_")
    }

    /// The effect with this name, as its id or its key.
    #[must_use]
    pub fn with_id(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id || kind.key() == id)
    }

    /// Where in the making of a frame it works.
    #[must_use]
    pub const fn stage(self) -> EffectStage {
        match self {
            Self::LightDrift
            | Self::LightSwitching
            | Self::CastShadows
            | Self::WetGround
            | Self::FoliageMotion
            | Self::CameraShake
            | Self::MotionBlur
            | Self::RollingShutter => EffectStage::Scene,
            Self::Rain | Self::Snow | Self::Exposure | Self::Noise => EffectStage::Sensor,
            Self::Compression
            | Self::Drop
            | Self::Late
            | Self::Duplicate
            | Self::Corrupt
            | Self::Clock
            | Self::Jitter => EffectStage::Delivery,
        }
    }
}

/// What the lights are multiplied by at a time; ones where nothing changes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightGains {
    /// Of the sun, per colour.
    pub sun: DVec3,
    /// Of the sky, what it lends the ground's bounce included, per colour.
    pub sky: DVec3,
    /// Of every lamp, per colour.
    pub lamps: DVec3,
}

impl Default for LightGains {
    fn default() -> Self {
        Self { sun: DVec3::ONE, sky: DVec3::ONE, lamps: DVec3::ONE }
    }
}

impl Effects {
    /// Every value out of its range, by its JSON pointer relative to the effects object.
    #[must_use]
    pub fn validate(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        macro_rules! check {
            ($($field:ident),*) => {
                $(if let Some(settings) = &self.$field {
                    settings.check(&mut Ranges::new(concat!("/", stringify!($field)), &mut faults));
                })*
            };
        }
        check!(light_drift, light_switching, cast_shadows, wet_ground, foliage_motion, camera_shake);
        check!(motion_blur, rolling_shutter, rain, snow, exposure, noise);
        check!(compression, drop, late, duplicate, corrupt, clock, jitter);
        faults
    }

    /// Whether the effect is named.
    #[must_use]
    pub const fn names(&self, kind: EffectKind) -> bool {
        match kind {
            EffectKind::LightDrift => self.light_drift.is_some(),
            EffectKind::LightSwitching => self.light_switching.is_some(),
            EffectKind::CastShadows => self.cast_shadows.is_some(),
            EffectKind::WetGround => self.wet_ground.is_some(),
            EffectKind::FoliageMotion => self.foliage_motion.is_some(),
            EffectKind::CameraShake => self.camera_shake.is_some(),
            EffectKind::MotionBlur => self.motion_blur.is_some(),
            EffectKind::RollingShutter => self.rolling_shutter.is_some(),
            EffectKind::Rain => self.rain.is_some(),
            EffectKind::Snow => self.snow.is_some(),
            EffectKind::Exposure => self.exposure.is_some(),
            EffectKind::Noise => self.noise.is_some(),
            EffectKind::Compression => self.compression.is_some(),
            EffectKind::Drop => self.drop.is_some(),
            EffectKind::Late => self.late.is_some(),
            EffectKind::Duplicate => self.duplicate.is_some(),
            EffectKind::Corrupt => self.corrupt.is_some(),
            EffectKind::Clock => self.clock.is_some(),
            EffectKind::Jitter => self.jitter.is_some(),
        }
    }

    /// The same effects with this one named (with its defaults, unless it has settings) or not.
    #[must_use]
    pub fn with(mut self, kind: EffectKind) -> Self {
        macro_rules! name {
            ($field:ident) => {{
                self.$field.get_or_insert_default();
            }};
        }
        match kind {
            EffectKind::LightDrift => name!(light_drift),
            EffectKind::LightSwitching => name!(light_switching),
            EffectKind::CastShadows => name!(cast_shadows),
            EffectKind::WetGround => name!(wet_ground),
            EffectKind::FoliageMotion => name!(foliage_motion),
            EffectKind::CameraShake => name!(camera_shake),
            EffectKind::MotionBlur => name!(motion_blur),
            EffectKind::RollingShutter => name!(rolling_shutter),
            EffectKind::Rain => name!(rain),
            EffectKind::Snow => name!(snow),
            EffectKind::Exposure => name!(exposure),
            EffectKind::Noise => name!(noise),
            EffectKind::Compression => name!(compression),
            EffectKind::Drop => name!(drop),
            EffectKind::Late => name!(late),
            EffectKind::Duplicate => name!(duplicate),
            EffectKind::Corrupt => name!(corrupt),
            EffectKind::Clock => name!(clock),
            EffectKind::Jitter => name!(jitter),
        }
        self
    }

    /// The same effects without this one.
    #[must_use]
    pub fn without(mut self, kind: EffectKind) -> Self {
        match kind {
            EffectKind::LightDrift => self.light_drift = None,
            EffectKind::LightSwitching => self.light_switching = None,
            EffectKind::CastShadows => self.cast_shadows = None,
            EffectKind::WetGround => self.wet_ground = None,
            EffectKind::FoliageMotion => self.foliage_motion = None,
            EffectKind::CameraShake => self.camera_shake = None,
            EffectKind::MotionBlur => self.motion_blur = None,
            EffectKind::RollingShutter => self.rolling_shutter = None,
            EffectKind::Rain => self.rain = None,
            EffectKind::Snow => self.snow = None,
            EffectKind::Exposure => self.exposure = None,
            EffectKind::Noise => self.noise = None,
            EffectKind::Compression => self.compression = None,
            EffectKind::Drop => self.drop = None,
            EffectKind::Late => self.late = None,
            EffectKind::Duplicate => self.duplicate = None,
            EffectKind::Corrupt => self.corrupt = None,
            EffectKind::Clock => self.clock = None,
            EffectKind::Jitter => self.jitter = None,
        }
        self
    }

    /// The named effects, in the order in which they work.
    pub fn named(&self) -> impl Iterator<Item = EffectKind> + '_ {
        EffectKind::ALL.into_iter().filter(|kind| self.names(*kind))
    }

    /// What the lights are multiplied by at `time_secs`.
    #[must_use]
    pub fn light_gains(&self, time_secs: f64, tally: &Tally<'_>) -> LightGains {
        let mut gains = LightGains::default();
        if let Some(drift) = &self.light_drift {
            drift.change(&mut gains, time_secs, tally);
        }
        if let Some(switching) = &self.light_switching {
            switching.change(&mut gains, time_secs, tally);
        }
        gains
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn all() -> Effects {
        EffectKind::ALL.into_iter().fold(Effects::default(), Effects::with)
    }

    #[test]
    fn every_effect_can_be_named_alone_and_taken_away() {
        for kind in EffectKind::ALL {
            let alone = Effects::default().with(kind);
            assert_eq!(alone.named().collect::<Vec<_>>(), [kind]);
            let read: Effects = serde_json::from_value(json!({ kind.key(): {} })).expect("its key is known");
            assert_eq!(read, alone, "{}", kind.id());
            assert_eq!(alone.clone().without(kind), Effects::default());
            assert_eq!(all().without(kind).named().count(), EffectKind::ALL.len() - 1);
        }
    }

    #[test]
    fn defaults_are_in_their_ranges_and_survive_being_written() {
        assert_eq!(all().validate(), []);
        let text = serde_json::to_string(&all()).expect("plain data");
        assert_eq!(serde_json::from_str::<Effects>(&text).expect("its own text"), all());
        assert_eq!(serde_json::to_value(Effects::default()).expect("plain data"), json!({"seed": 0}));
    }

    #[test]
    fn what_is_out_of_range_is_named_by_its_place() {
        let check = |value: serde_json::Value, place: &str| {
            let effects: Effects = serde_json::from_value(value).expect("the right types");
            let faults = effects.validate();
            assert!(faults.iter().any(|fault| fault.place == place), "{place}: {faults:?}");
        };
        check(json!({"noise": {"full_well_electrons": 0}}), "/noise/full_well_electrons");
        check(json!({"rain": {"rate_mm_per_hour": -1}}), "/rain/rate_mm_per_hour");
        check(json!({"rain": {"wind_m_per_sec": [0, 1e9]}}), "/rain/wind_m_per_sec/1");
        check(json!({"exposure": {"least_gain": 4, "most_gain": 2}}), "/exposure/least_gain");
        check(json!({"drop": {"share": 1.5}}), "/drop/share");
        check(json!({"compression": {"quantizer": 64}}), "/compression/quantizer");
        let unknown = serde_json::from_value::<Effects>(json!({"rain": {"speed": 3}}));
        assert!(unknown.expect_err("no such key").to_string().contains("speed"));
    }

    #[test]
    fn lights_are_left_alone_unless_named() {
        let entries = Entries::default();
        let gains = Effects::default().light_gains(100.0, &entries.tally());
        assert_eq!(gains, LightGains::default());
        assert!(EffectKind::ALL.iter().all(|kind| entries.count(*kind) == 0));
    }
}
