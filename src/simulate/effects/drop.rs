//! Frames that are lost on their way, alone or in bursts.
//!
//! Settings and a pure function of the frame's number.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Frames of the longest burst.
const MOST_BURST_FRAMES: u32 = 1000;

/// Settings of the loss.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Drop {
    /// Share of frames that are lost, 0 to 0.99. Default 0.1.
    pub share: f64,
    /// Frames that are lost together, 1 to 1000; bursts may run into each other. Default 1.
    pub burst_frames: u32,
}

impl Default for Drop {
    fn default() -> Self {
        Self { share: 0.1, burst_frames: 1 }
    }
}

impl Drop {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("share", self.share, 0.0..=0.99);
        ranges.count("burst_frames", self.burst_frames, 1..=MOST_BURST_FRAMES);
    }

    /// Whether the frame is lost; `camera` is the camera's draw.
    #[must_use]
    pub fn loses(&self, camera: Draw, frame: u64, tally: &Tally<'_>) -> bool {
        tally.enter(EffectKind::Drop);
        // A frame is lost if any of the last n frames began a burst: 1 - (1 - start)^n is the share.
        let start = 1.0 - (1.0 - self.share).powf(1.0 / f64::from(self.burst_frames.max(1)));
        // Bursts may have begun before the first frame: they are counted from as far back as the longest reaches.
        let last = frame + u64::from(MOST_BURST_FRAMES);
        let first = last + 1 - u64::from(self.burst_frames.clamp(1, MOST_BURST_FRAMES));
        let draw = camera.of_effect(EffectKind::Drop);
        (first..=last).any(|at| draw.unit(at) < start)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn the_share_is_lost_alone_or_in_bursts() {
        let entries = Entries::default();
        let draw = Draw::of_camera(4, "a");
        for (share, burst_frames) in [(0.1, 1), (0.3, 5), (0.0, 3)] {
            let drop = Drop { share, burst_frames };
            let lost: Vec<bool> = (0..20_000).map(|n| drop.loses(draw, n, &entries.tally())).collect();
            let n_lost = lost.iter().filter(|is_lost| **is_lost).count() as f64;
            assert!((n_lost / 20_000.0 - share).abs() < 0.03, "{share}: {n_lost}");
            let n_bursts = lost.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64;
            if share > 0.0 {
                assert!(n_lost / n_bursts >= f64::from(burst_frames) * 0.99, "{n_lost} in {n_bursts}");
            }
        }
        assert_eq!(entries.count(EffectKind::Drop), 60_000);
        // The first frames are lost as often as any.
        let drop = Drop { share: 0.5, burst_frames: 1000 };
        let lost = |camera: u64| drop.loses(Draw::of_camera(camera, "a"), 0, &entries.tally());
        let n_lost = (0..1000).filter(|camera| lost(*camera)).count();
        assert!((440..560).contains(&n_lost), "{n_lost}");
    }
}
