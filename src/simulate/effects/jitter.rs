//! A network whose delay varies.
//!
//! Settings and a pure function of the frame's number: a least delay and an exponential rest, as queues give.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Jitter {
    /// Least delay, seconds, 0 to 60. Default 0.02.
    pub least_delay_secs: f64,
    /// Mean of what comes on top, seconds, 0 to 60. Default 0.03.
    pub mean_extra_secs: f64,
    /// Whether a later frame may overtake an earlier one (datagrams) or waits for it (a stream). Default false.
    pub overtakes: bool,
}

impl Default for Jitter {
    fn default() -> Self {
        Self { least_delay_secs: 0.02, mean_extra_secs: 0.03, overtakes: false }
    }
}

impl Jitter {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("least_delay_secs", self.least_delay_secs, 0.0..=60.0);
        ranges.number("mean_extra_secs", self.mean_extra_secs, 0.0..=60.0);
    }

    /// Delay of the frame, seconds; `camera` is the camera's draw.
    #[must_use]
    pub fn delay_secs(&self, camera: Draw, frame: u64, tally: &Tally<'_>) -> f64 {
        tally.enter(EffectKind::Jitter);
        let number = camera.at_frame(frame).of_effect(EffectKind::Jitter).unit(0);
        self.least_delay_secs - self.mean_extra_secs * (1.0 - number).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn delays_have_their_least_and_their_mean() {
        let entries = Entries::default();
        let jitter = Jitter { least_delay_secs: 0.1, mean_extra_secs: 0.05, overtakes: false };
        let draw = Draw::of_camera(1, "a");
        let delays: Vec<f64> =
            (0..20_000).map(|frame| jitter.delay_secs(draw, frame, &entries.tally())).collect();
        assert!(delays.iter().all(|delay| (0.1..10.0).contains(delay)));
        let mean = delays.iter().sum::<f64>() / 20_000.0;
        assert!((mean - 0.15).abs() < 0.002, "{mean}");
        assert_eq!(entries.count(EffectKind::Jitter), 20_000);
    }
}
