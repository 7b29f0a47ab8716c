//! Switches the stages of detection on and off by what a camera's pictures show, and says why.
//!
//! Measured figures flow in; whether a stage runs flows out, with the figure and the limits that decided. Between the two limits of a
//! stage nothing changes, and a stage is switched off only after its figure was low for a while.

use crate::config::StageChoice;
use serde::Serialize;
use std::fmt;

/// A stage of detection that is switched by what pictures show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StageKind {
    /// Tells cast shadows from what moves.
    Shadow,
    /// Lowers thresholds before dark backgrounds, as far as the noise allows.
    Noise,
    /// Raises thresholds where verdicts keep turning.
    Flicker,
    /// Makes background of pieces that mostly flutter.
    Blinking,
    /// Shifts the pictures of a shaking camera back.
    Shake,
    /// Makes the background as light as the picture became.
    Light,
}

impl StageKind {
    /// Returns its name, as the API and settings have it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Shadow => "shadow",
            Self::Noise => "noise",
            Self::Flicker => "flicker",
            Self::Blinking => "blinking",
            Self::Shake => "shake",
            Self::Light => "light",
        }
    }

    const fn rule(self) -> Rule {
        match self {
            // It is on until its figure says otherwise.
            Self::Shadow => Rule { begins_on: true, ..Rule::new("shadow_share", [0.01, 0.003], 60.0) },
            // Costs a table, and thresholds stay what they are of lumas of which nothing is known.
            Self::Noise => Rule { begins_on: true, ..Rule::new("noise_share", [0.0, 0.0], 0.0) },
            // Counts sink by themselves, so the figure is steady enough without waiting.
            Self::Flicker => Rule::new("flicker_share", [0.0005, 0.0001], 0.0),
            Self::Blinking => Rule::new("flicker_share", [0.005, 0.002], 60.0),
            // The figure is a mean of five seconds.
            Self::Shake => Rule::new("shake_px", [0.9, 0.5], 0.0),
            Self::Light => Rule::new("gain_drift", [0.02, 0.01], 60.0),
        }
    }
}

/// Rule by which a stage is switched.
#[derive(Clone, Copy, Debug)]
struct Rule {
    quantity: &'static str,
    on_above: f64,
    off_below: f64,
    off_after_secs: f64,
    begins_on: bool,
}

impl Rule {
    const fn new(quantity: &'static str, [on_above, off_below]: [f64; 2], off_after_secs: f64) -> Self {
        Self { quantity, on_above, off_below, off_after_secs, begins_on: false }
    }
}

/// One stage's switch for one camera.
#[derive(Clone, Debug)]
pub struct Switch {
    kind: StageKind,
    is_on: bool,
    measured: Option<f64>,
    low_secs: f64,
    n_frames: u64,
}

impl Switch {
    /// Returns a switch that has measured nothing.
    #[must_use]
    pub const fn new(kind: StageKind) -> Self {
        Self { kind, is_on: kind.rule().begins_on, measured: None, low_secs: 0.0, n_frames: 0 }
    }

    /// Takes the stage's figure, `dt_secs` after the one before it. Figures that are not finite count as none.
    pub fn observe(&mut self, measured: f64, dt_secs: f64) {
        if !measured.is_finite() {
            return;
        }
        self.measured = Some(measured);
        let rule = self.kind.rule();
        if measured > rule.on_above {
            (self.is_on, self.low_secs) = (true, 0.0);
        } else if measured >= rule.off_below {
            self.low_secs = 0.0;
        } else {
            self.low_secs += if dt_secs > 0.0 { dt_secs } else { 0.0 };
            self.is_on &= self.low_secs < rule.off_after_secs;
        }
    }

    /// Returns whether the stage runs, by what somebody chose.
    #[must_use]
    pub const fn is_on(&self, choice: StageChoice) -> bool {
        match choice {
            StageChoice::Auto => self.is_on,
            StageChoice::On => true,
            StageChoice::Off => false,
        }
    }

    /// Counts a frame in which the stage ran.
    pub const fn count(&mut self) {
        self.n_frames += 1;
    }

    /// Returns the stage's state, for people and programs.
    #[must_use]
    pub fn state(&self, choice: StageChoice) -> StageState {
        let Rule { quantity, on_above, off_below, .. } = self.kind.rule();
        StageState {
            stage: self.kind,
            is_on: self.is_on(choice),
            choice,
            quantity,
            measured: self.measured,
            on_above,
            off_below,
            frames: self.n_frames,
        }
    }
}

/// State of one stage of one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StageState {
    /// The stage.
    pub stage: StageKind,
    /// True while it runs.
    pub is_on: bool,
    /// Choice that settings make.
    pub choice: StageChoice,
    /// Name of the figure that decides where nothing is set: `shadow_share` (of the foreground that keeps its background's
    /// structure), `noise_share` (of full scale, standard deviation), `flicker_share` (of the pixels), `shake_px` (root mean square),
    /// `gain_drift` (last change of the light, share).
    pub quantity: &'static str,
    /// The figure; none before it was measured.
    pub measured: Option<f64>,
    /// The stage is switched on above this ...
    pub on_above: f64,
    /// ... and off once the figure was below this for a while.
    pub off_below: f64,
    /// Frames in which it ran, or was tried while it is off: since pictures of this size were first looked at for shake and light, of any
    /// size for the others.
    pub frames: u64,
}

impl StageState {
    /// Returns the state of a stage that cannot run where it is: off, with no figure.
    #[must_use]
    pub const fn impossible(self) -> Self {
        Self { is_on: false, measured: None, ..self }
    }
}

impl fmt::Display for StageState {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, is_on) = (self.stage.as_str(), if self.is_on { "on" } else { "off" });
        write!(to, "{name} {is_on} ({}), {} ", self.choice.as_str(), self.quantity)?;
        match self.measured {
            Some(measured) => write!(to, "{measured:.5}")?,
            None => to.write_str("not measured")?,
        }
        write!(
            to,
            ", on above {}, off below {}; ran in {} frames",
            self.on_above, self.off_below, self.frames
        )
    }
}

/// A mean in which what is older counts less.
#[derive(Clone, Debug, Default)]
pub struct RunningMean {
    mean: f64,
    n: u32,
}

impl RunningMean {
    /// Takes a value, `dt_secs` after the one before it. What is `memory_secs` old counts a third of it; the first values count alike.
    pub fn add(&mut self, value: f64, dt_secs: f64, memory_secs: f64) {
        if !value.is_finite() {
            return;
        }
        self.n = self.n.saturating_add(1);
        let dt_secs = if dt_secs > 0.0 { dt_secs } else { 0.0 };
        let share = (1.0 - (-dt_secs / memory_secs).exp()).max(1.0 / f64::from(self.n));
        self.mean += share * (value - self.mean);
    }

    /// Returns the mean; none of fewer values than `least`.
    #[must_use]
    pub fn of_at_least(&self, least: u32) -> Option<f64> {
        (self.n >= least.max(1)).then_some(self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_goes_on_at_once_and_off_only_after_its_figure_was_low_for_long() {
        let mut switch = Switch::new(StageKind::Blinking);
        assert!(!switch.is_on(StageChoice::Auto));
        switch.observe(0.005, 1.0);
        assert!(!switch.is_on(StageChoice::Auto), "the limit itself is not above it");
        switch.observe(0.0051, 1.0);
        assert!(switch.is_on(StageChoice::Auto));
        // Between the limits nothing changes, for however long, and what was low before is forgotten.
        for measured in [0.001, 0.003] {
            for _ in 0..59 {
                switch.observe(measured, 1.0);
            }
            assert!(switch.is_on(StageChoice::Auto), "{measured}");
        }
        for _ in 0..59 {
            switch.observe(0.0019, 1.0);
        }
        assert!(switch.is_on(StageChoice::Auto));
        switch.observe(0.0019, 1.0);
        assert!(!switch.is_on(StageChoice::Auto));
        switch.observe(0.003, 1.0);
        assert!(!switch.is_on(StageChoice::Auto));
    }

    #[test]
    fn what_is_chosen_counts_and_the_figure_is_told_all_the_same() {
        let mut switch = Switch::new(StageKind::Shake);
        switch.observe(3.0, 0.1);
        for (choice, is_on) in [(StageChoice::Auto, true), (StageChoice::On, true), (StageChoice::Off, false)]
        {
            let state = switch.state(choice);
            assert_eq!((state.is_on, state.measured, state.quantity), (is_on, Some(3.0), "shake_px"));
        }
        switch.observe(0.1, 0.1);
        assert!(!switch.is_on(StageChoice::Auto) && switch.is_on(StageChoice::On));
    }

    #[test]
    fn figures_and_times_that_are_no_numbers_change_nothing() {
        let mut switch = Switch::new(StageKind::Shadow);
        for figure in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            switch.observe(figure, 1e9);
        }
        assert_eq!((switch.is_on(StageChoice::Auto), switch.state(StageChoice::Auto).measured), (true, None));
        for dt_secs in [f64::NAN, -5.0, 0.0] {
            switch.observe(0.0, dt_secs);
        }
        assert!(switch.is_on(StageChoice::Auto));
        switch.observe(0.0, f64::INFINITY);
        assert!(!switch.is_on(StageChoice::Auto));
    }

    #[test]
    fn the_first_values_count_alike_and_old_ones_a_third() {
        let mut mean = RunningMean::default();
        assert_eq!(mean.of_at_least(0), None);
        for value in [1.0, 2.0, 6.0, f64::NAN] {
            mean.add(value, 0.0, 10.0);
        }
        assert!((mean.of_at_least(3).unwrap() - 3.0).abs() < 1e-12);
        assert_eq!(mean.of_at_least(4), None);
        for _ in 0..1000 {
            mean.add(0.0, 0.1, 10.0);
        }
        let mut later = mean.clone();
        for _ in 0..100 {
            later.add(1.0, 0.1, 10.0);
        }
        assert!((later.of_at_least(1).unwrap() - (1.0 - (-1.0_f64).exp())).abs() < 1e-3);
    }
}
