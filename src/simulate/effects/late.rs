//! Frames that arrive much later than they should, as after a stall.
//!
//! Settings and a pure function of the frame's number.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the delay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Late {
    /// Share of frames that are late, 0 to 1. Default 0.1.
    pub share: f64,
    /// How much later than they would have arrived, seconds, 0 to 3600. Default 0.5.
    pub delay_secs: f64,
}

impl Default for Late {
    fn default() -> Self {
        Self { share: 0.1, delay_secs: 0.5 }
    }
}

impl Late {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("share", self.share, 0.0..=1.0);
        ranges.number("delay_secs", self.delay_secs, 0.0..=3600.0);
    }

    /// How late the frame is, if it is; `camera` is the camera's draw.
    #[must_use]
    pub fn delay_secs(&self, camera: Draw, frame: u64, tally: &Tally<'_>) -> Option<f64> {
        tally.enter(EffectKind::Late);
        let is_late = camera.at_frame(frame).of_effect(EffectKind::Late).unit(0) < self.share;
        is_late.then_some(self.delay_secs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn the_share_is_late() {
        let entries = Entries::default();
        let late = Late { share: 0.25, delay_secs: 2.0 };
        let draw = Draw::of_camera(1, "a");
        let delays = (0..10_000).filter_map(|frame| late.delay_secs(draw, frame, &entries.tally()));
        let n_late = delays.inspect(|delay| assert_eq!(*delay, 2.0)).count();
        assert!((2300..2700).contains(&n_late), "{n_late}");
        assert_eq!(entries.count(EffectKind::Late), 10_000);
    }
}
