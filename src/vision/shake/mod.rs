//! Measures how far a picture is shifted against its background while its camera shakes, and shifts pictures back.
//!
//! Luma of a frame and of its background flow in; a shift in whole pixels flows out, where enough of the place agrees on it. Knows
//! nothing of models, of what moves, or of time beyond that which passes.
//!
//! Corners of the place are looked for near where they belong. Each votes for a shift: what moves votes for many, the place for one.
//!
//! Inside: corners and their votes (`patches`), whether the camera shakes (this file), and pictures and masks that are shifted (`shifted`).

mod patches;
mod shifted;

pub use shifted::{shifted_back, steadied};

use crate::config::StageChoice;
use crate::frame::Plane;
use crate::stage::{RunningMean, StageKind, StageState, Switch};
use patches::Patches;

/// Greatest shift that is looked for, pixels each way.
pub const GREATEST_PX: i32 = 32;

/// Shifts count for so long, seconds.
const REMEMBERED_SECS: f64 = 5.0;

/// Fewer shifts than this say nothing.
const LEAST_SHIFTS: u32 = 8;

/// Number of frames from one that is looked at to the next while a camera does not shake; fewer in its first seconds.
const EVERY: u32 = 8;
const EVERY_AT_FIRST: u32 = 2;
const FIRST_SECS: f64 = 10.0;

/// Time after which corners are chosen anew from the background, seconds.
const CHOSEN_SECS: f64 = 10.0;

/// A shift of a picture's content against its background, pixels to the right and down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shift {
    /// Pixels to the right.
    pub x: i32,
    /// Pixels down.
    pub y: i32,
}

impl Shift {
    /// Returns the shift with its sides multiplied.
    #[must_use]
    pub const fn times(self, factor: i32) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
    }

    /// Returns whether nothing is shifted.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.x == 0 && self.y == 0
    }
}

/// Watches the shifts of one camera's pictures; keeps its memory from frame to frame.
#[derive(Debug)]
pub struct Shake {
    patches: Patches,
    /// Size of the pictures that the corners are of.
    size_px: (u32, u32),
    switch: Switch,
    /// Mean square of the shifts, pixels squared.
    mean_square_px2: RunningMean,
    n_frames: u32,
    seen_secs: f64,
    chosen_secs: f64,
}

impl Default for Shake {
    fn default() -> Self {
        Self {
            patches: Patches::default(),
            size_px: (0, 0),
            switch: Switch::new(StageKind::Shake),
            mean_square_px2: RunningMean::default(),
            n_frames: 0,
            seen_secs: 0.0,
            chosen_secs: 0.0,
        }
    }
}

impl Shake {
    /// Returns whether pictures are shifted back, and the root mean square of the shifts of late.
    #[must_use]
    pub fn state(&self, choice: StageChoice) -> StageState {
        self.switch.state(choice)
    }

    /// Takes the luma of a frame, `dt_secs` after the one before it, and of its place: the background, or where that has hardly been
    /// learned, the frame itself. Returns by how much the frame is to be shifted back: by nothing while the camera does not shake, or
    /// where too little of the place agrees.
    pub fn observe(
        &mut self,
        frame: Plane<'_>,
        place: Plane<'_>,
        dt_secs: f64,
        choice: StageChoice,
    ) -> Shift {
        if choice == StageChoice::Off {
            // Nothing of before the pause is to be believed after it.
            if self.n_frames > 0 {
                *self = Self::default();
            }
            return Shift::default();
        }
        let is_on = self.switch.is_on(choice);
        let dt_secs = if dt_secs > 0.0 { dt_secs.min(CHOSEN_SECS) } else { 0.0 };
        if self.size_px != (frame.width, frame.height) {
            *self = Self { size_px: (frame.width, frame.height), ..Self::default() };
            self.patches.choose(place);
        }
        self.n_frames = self.n_frames.wrapping_add(1);
        self.seen_secs += dt_secs;
        self.chosen_secs += dt_secs;
        let every = if self.seen_secs < FIRST_SECS { EVERY_AT_FIRST } else { EVERY };
        if !is_on && !self.n_frames.is_multiple_of(every) {
            return Shift::default();
        }
        if self.chosen_secs >= CHOSEN_SECS {
            self.chosen_secs = 0.0;
            self.patches.choose(place);
        }
        if is_on {
            self.switch.count();
        }
        let Some(shift) = self.patches.shift(frame) else { return Shift::default() };
        let step_secs = if is_on { dt_secs } else { dt_secs * f64::from(every) };
        self.remember(shift, step_secs);
        if self.switch.is_on(choice) { shift } else { Shift::default() }
    }

    fn remember(&mut self, shift: Shift, step_secs: f64) {
        self.mean_square_px2.add(
            f64::from(shift.x * shift.x + shift.y * shift.y),
            step_secs,
            REMEMBERED_SECS,
        );
        if let Some(mean_square_px2) = self.mean_square_px2.of_at_least(LEAST_SHIFTS) {
            self.switch.observe(mean_square_px2.sqrt(), step_secs);
        }
    }
}

/// Measures the shift of one frame against its background, whatever came before: of frames that are looked at in any order.
#[must_use]
pub fn shift_of(frame: Plane<'_>, background: Plane<'_>) -> Shift {
    let mut patches = Patches::default();
    patches.choose(background);
    patches.shift(frame).unwrap_or_default()
}

#[cfg(test)]
mod tests;
