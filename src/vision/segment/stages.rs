//! Decides which stages of segmentation run on a camera's pictures, by what they show.
//!
//! Figures that the stages measure as they run flow in; a stage that is off is tried on a frame now and then, if settings leave it to
//! the pictures, so that it can be switched on again.

use super::memory::Memory;
use crate::config::{SegmentSettings, StageChoice};
use crate::stage::{RunningMean, StageKind, StageState, Switch};

/// Frames from one in which shadows are looked for to the next, while they are not told.
const SHADOW_LOOKS: u32 = 16;

/// Shares of shadows older than this count less than a third.
const SHADOW_SECS: f64 = 10.0;

/// Time that a share of shadows stands for at most, seconds.
const LONGEST_WAIT_SECS: f64 = 1.0;

/// Fewer shares of shadows than this say nothing.
const LEAST_SHADOW_SHARES: u32 = 8;

/// Work on shadows in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShadowWork {
    /// They are told from what moves.
    Told,
    /// They are measured, and what moves is as without.
    Measured,
    /// Nothing.
    None,
}

/// Stages that run on one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Running {
    pub(super) shadow: ShadowWork,
    /// Thresholds follow luma and noise.
    pub(super) has_noise: bool,
    /// Thresholds follow flicker.
    pub(super) has_flicker: bool,
    /// Pieces that flutter are left out.
    pub(super) has_blinking: bool,
}

/// Switches of segmentation's stages.
#[derive(Debug)]
pub(super) struct Stages {
    shadow: Switch,
    noise: Switch,
    flicker: Switch,
    blinking: Switch,
    shadow_share: RunningMean,
    n_since_look: u32,
    /// Time since the share of shadows was measured.
    since_share_secs: f64,
}

impl Default for Stages {
    fn default() -> Self {
        Self {
            shadow: Switch::new(StageKind::Shadow),
            noise: Switch::new(StageKind::Noise),
            flicker: Switch::new(StageKind::Flicker),
            blinking: Switch::new(StageKind::Blinking),
            shadow_share: RunningMean::default(),
            n_since_look: 0,
            since_share_secs: 0.0,
        }
    }
}

impl Stages {
    /// Returns what runs on the next frame, `dt_secs` after the one before it, and counts it.
    pub(super) fn begin(&mut self, settings: &SegmentSettings, memory: &Memory, dt_secs: f64) -> Running {
        if let Some(share) = memory.flicker.share() {
            self.flicker.observe(f64::from(share), dt_secs);
            self.blinking.observe(f64::from(share), dt_secs);
        }
        if let Some(deviation) = memory.noise.typical() {
            self.noise.observe(f64::from(deviation), dt_secs);
        }
        // Time in which nobody is seen tells nothing of shadows.
        self.since_share_secs = if dt_secs > 0.0 {
            (self.since_share_secs + dt_secs).min(LONGEST_WAIT_SECS)
        } else {
            self.since_share_secs
        };
        let running = Running {
            shadow: if self.shadow.is_on(settings.shadow_choice()) {
                ShadowWork::Told
            } else if settings.shadow_choice() == StageChoice::Auto && self.n_since_look >= SHADOW_LOOKS {
                ShadowWork::Measured
            } else {
                ShadowWork::None
            },
            has_noise: self.noise.is_on(settings.noise_choice()),
            has_flicker: self.flicker.is_on(settings.flicker_choice()),
            has_blinking: self.blinking.is_on(settings.blinking_choice()),
        };
        self.n_since_look =
            if running.shadow == ShadowWork::None { self.n_since_look.saturating_add(1) } else { 0 };
        let switches = [
            (&mut self.shadow, running.shadow != ShadowWork::None),
            (&mut self.noise, running.has_noise),
            (&mut self.flicker, running.has_flicker),
            (&mut self.blinking, running.has_blinking),
        ];
        for (switch, _) in switches.into_iter().filter(|(_, runs)| *runs) {
            switch.count();
        }
        running
    }

    /// Takes the share of a frame's foreground that is certain to be cast shadow.
    pub(super) fn observe_shadow(&mut self, share: f64) {
        let waited_secs = std::mem::take(&mut self.since_share_secs);
        self.shadow_share.add(share, waited_secs, SHADOW_SECS);
        if let Some(share) = self.shadow_share.of_at_least(LEAST_SHADOW_SHARES) {
            self.shadow.observe(share, waited_secs);
        }
    }

    /// Returns the states of all, in the order in which they run.
    pub(super) fn states(&self, settings: &SegmentSettings) -> [StageState; 4] {
        [
            self.noise.state(settings.noise_choice()),
            self.flicker.state(settings.flicker_choice()),
            self.shadow.state(settings.shadow_choice()),
            self.blinking.state(settings.blinking_choice()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_without_a_shadow_after_a_quiet_hour_does_not_switch_shadows_off() {
        let (settings, memory) = (SegmentSettings::default(), Memory::default());
        let mut stages = Stages::default();
        for _ in 0..20 {
            stages.begin(&settings, &memory, 0.1);
            stages.observe_shadow(0.2);
        }
        for _ in 0..36_000 {
            stages.begin(&settings, &memory, 0.1);
        }
        stages.observe_shadow(0.0);
        assert_eq!(stages.begin(&settings, &memory, 0.1).shadow, ShadowWork::Told);
        // Two minutes of people without shadows do: half of one until the mean is low, and one of waiting.
        for _ in 0..1200 {
            stages.begin(&settings, &memory, 0.1);
            stages.observe_shadow(0.0);
        }
        assert_ne!(stages.begin(&settings, &memory, 0.1).shadow, ShadowWork::Told);
    }
}
