//! Frames that arrive twice.
//!
//! Settings and a pure function of the frame's number.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the duplication.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Duplicate {
    /// Share of frames that arrive twice, 0 to 1. Default 0.1.
    pub share: f64,
}

impl Default for Duplicate {
    fn default() -> Self {
        Self { share: 0.1 }
    }
}

impl Duplicate {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("share", self.share, 0.0..=1.0);
    }

    /// Whether the frame arrives twice; `camera` is the camera's draw.
    #[must_use]
    pub fn repeats(&self, camera: Draw, frame: u64, tally: &Tally<'_>) -> bool {
        tally.enter(EffectKind::Duplicate);
        camera.at_frame(frame).of_effect(EffectKind::Duplicate).unit(0) < self.share
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn the_share_comes_twice() {
        let entries = Entries::default();
        let draw = Draw::of_camera(1, "a");
        let count = |share| {
            let duplicate = Duplicate { share };
            (0..10_000).filter(|frame| duplicate.repeats(draw, *frame, &entries.tally())).count()
        };
        assert!((1800..2200).contains(&count(0.2)));
        assert_eq!((count(0.0), count(1.0)), (0, 10_000));
        assert_eq!(entries.count(EffectKind::Duplicate), 30_000);
    }
}
