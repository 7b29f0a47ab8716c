//! Makes a background as light as its camera's pictures have become: an exposure that creeps, a cloud, dusk.

use super::Model;
use videofields_vision::background::gain_of;
use videofields_vision::config::StageChoice;
use videofields_vision::frame::YuvImage;
use videofields_vision::stage::{StageKind, StageState, Switch};

/// The light is looked at in every so manieth frame, and after so long where frames come more seldom.
const FRAMES: u32 = 4;
const LOOK_SECS: f64 = 0.16;

/// The light is followed where it changed by at least this share.
const LEAST_GAIN: f32 = 0.02;

/// Time since the light was looked at, and how much it changes.
#[derive(Debug)]
pub(super) struct Light {
    switch: Switch,
    n_since: u32,
    since_secs: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self { switch: Switch::new(StageKind::Light), n_since: 0, since_secs: 0.0 }
    }
}

impl Light {
    /// Returns whether the light was followed of late, and its last change.
    pub(super) fn state(&self, choice: StageChoice) -> StageState {
        self.switch.state(choice)
    }

    /// Counts a frame and returns whether its light is to be looked at.
    fn is_due(&mut self, dt_secs: f64, choice: StageChoice) -> bool {
        if choice == StageChoice::Off {
            *self = Self::default();
            return false;
        }
        self.n_since = self.n_since.saturating_add(1);
        self.since_secs += if dt_secs > 0.0 { dt_secs } else { 0.0 };
        self.n_since >= FRAMES || self.since_secs >= LOOK_SECS
    }
}

impl Model {
    /// Scales the background by what the whole picture's light became.
    pub(super) fn follow_light(&mut self, image: &YuvImage, dt_secs: f64, choice: StageChoice) {
        if !self.light.is_due(dt_secs, choice) || self.mixture.n_frames() == 0 {
            return;
        }
        self.light.n_since = 0;
        let waited_secs = std::mem::take(&mut self.light.since_secs);
        let (black, ..) = image.range().luma_offset_luma_scale_chroma_scale();
        let Some(gain) = gain_of(image.plane(0), self.mixture.background_planes()[0], black as u8) else {
            return;
        };
        let change = (gain - 1.0).abs();
        self.light.switch.observe(f64::from(change), waited_secs);
        if change >= LEAST_GAIN {
            self.light.switch.count();
            self.mixture.scale(gain);
            // The model is another: tiles that repeat the last picture are learned anew once.
            self.previous = None;
        }
    }
}
