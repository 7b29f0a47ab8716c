//! How fast a model learns: by time, faster at its start and after the light changed.
//!
//! The time between frames and the share of foreground flow in; the learning rate flows out. Knows nothing of pixels.

use super::light::LightChange;
use crate::config::BackgroundSettings;

/// The learning rate never falls below this, because 1 - a would round to 1 in f32 and nothing would be forgotten.
/// It binds only where tau is longer than about four days at 25 frames a second.
const LEAST_RATE: f64 = 1.2e-7;

/// What a model's learning rate depends on.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    tau_secs: f64,
    max_step_secs: f64,
    /// Frames learned since the start or since the last change of the light.
    pub(super) n_frames: u64,
    pub(super) change: LightChange,
}

impl Pace {
    pub(super) fn new(settings: &BackgroundSettings) -> Self {
        Self {
            tau_secs: settings.tau_secs,
            max_step_secs: settings.max_step_secs,
            n_frames: 0,
            change: LightChange::default(),
        }
    }

    /// The time that a frame stands for: 0 to the longest step, 0 for NaN.
    pub(super) fn step_secs(&self, dt_secs: f64) -> f64 {
        // `max` turns NaN into 0.
        dt_secs.max(0.0).min(self.max_step_secs)
    }

    /// Counts a frame that stands for `step_secs`; its learning rate: a = 1 - exp(-dt / tau), and no less than 1 / n
    /// while the model warms up, n counting this frame.
    pub(super) fn begin(&mut self, step_secs: f64) -> f64 {
        let warm_up = 1.0 / (self.n_frames.saturating_add(1) as f64);
        let rate = if step_secs > 0.0 {
            (-(-step_secs / self.tau_secs).exp_m1()).max(LEAST_RATE).max(warm_up)
        } else if self.n_frames == 0 {
            warm_up
        } else {
            0.0
        };
        if rate > 0.0 {
            self.n_frames = self.n_frames.saturating_add(1);
        }
        rate
    }

    /// Takes the frame's share of foreground; whether the light changed, upon which the model warms up again.
    pub(super) fn end(&mut self, foreground_share: f64, step_secs: f64) -> bool {
        let has_changed = self.change.observe(foreground_share, step_secs);
        if has_changed {
            // The next frame counts a half, the one after it a third: the new light leads after three frames, and
            // what was known stays behind it should the light go back.
            self.n_frames = 1;
        }
        has_changed
    }
}
