//! Lights that go on and off: a lamp that is switched, a cloud's edge.
//!
//! Settings and a pure function of time.

use super::ranges::Ranges;
use super::{EffectKind, LightGains, Tally};
use serde::{Deserialize, Serialize};

/// Which lights are switched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SwitchedLights {
    /// Lamps alone.
    Lamps,
    /// The sun alone: a cloud with a hard edge.
    Sun,
    /// Every light: a power cut in a hall, a whole sky.
    #[default]
    All,
}

/// Settings of the switching.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightSwitching {
    /// Which lights: `lamps`, `sun` or `all`. Default `all`.
    pub lights: SwitchedLights,
    /// Seconds from one switching off to the next, 0.1 to 86400. Default 12.
    pub period_secs: f64,
    /// Share of the period for which the lights are on, from its start, 0 to 1. Default 0.5.
    pub on_share: f64,
    /// What is left of the light when it is off, 0 to 1. Default 0.35.
    pub off_gain: f64,
    /// Seconds that a change takes, 0 (at once) to 60. Default 0.
    pub ramp_secs: f64,
}

impl Default for LightSwitching {
    fn default() -> Self {
        Self { lights: SwitchedLights::All, period_secs: 12.0, on_share: 0.5, off_gain: 0.35, ramp_secs: 0.0 }
    }
}

impl LightSwitching {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("period_secs", self.period_secs, 0.1..=86_400.0);
        ranges.number("on_share", self.on_share, 0.0..=1.0);
        ranges.number("off_gain", self.off_gain, 0.0..=1.0);
        ranges.number("ramp_secs", self.ramp_secs, 0.0..=60.0);
        let spans = [self.on_share, 1.0 - self.on_share].map(|share| share * self.period_secs);
        let fits = || spans.iter().all(|span| *span == 0.0 || self.ramp_secs <= *span);
        ranges.hold("ramp_secs", fits, "must fit into the time on and into the time off");
    }

    /// Multiplies the gains of the switched lights by that of `time_secs`.
    pub fn change(&self, gains: &mut LightGains, time_secs: f64, tally: &Tally<'_>) {
        tally.enter(EffectKind::LightSwitching);
        let gain = self.off_gain + (1.0 - self.off_gain) * self.brightness(time_secs);
        match self.lights {
            SwitchedLights::Lamps => gains.lamps *= gain,
            SwitchedLights::Sun => gains.sun *= gain,
            SwitchedLights::All => {
                gains.sun *= gain;
                gains.sky *= gain;
                gains.lamps *= gain;
            }
        }
    }

    /// 1 when on, 0 when off; a change begins at its time and takes the ramp.
    fn brightness(&self, time_secs: f64) -> f64 {
        let within = time_secs.rem_euclid(self.period_secs);
        let on_secs = self.on_share * self.period_secs;
        if self.on_share >= 1.0 {
            return 1.0;
        }
        if self.on_share <= 0.0 {
            return 0.0;
        }
        let ramp = |since: f64| if since >= self.ramp_secs { 1.0 } else { since / self.ramp_secs };
        if within < on_secs { ramp(within) } else { 1.0 - ramp(within - on_secs) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn lights_switch_at_their_times() {
        let entries = Entries::default();
        let check = |switching: LightSwitching, time: f64, sun: f64, lamps: f64| {
            let mut gains = LightGains::default();
            switching.change(&mut gains, time, &entries.tally());
            let got = (gains.sun.x, gains.lamps.x);
            assert!((got.0 - sun).abs() < 1e-9 && (got.1 - lamps).abs() < 1e-9, "{time}: {got:?}");
        };
        let sharp = LightSwitching { off_gain: 0.2, ..LightSwitching::default() };
        check(sharp, 0.0, 1.0, 1.0);
        check(sharp, 5.999, 1.0, 1.0);
        check(sharp, 6.0, 0.2, 0.2);
        check(sharp, 12.0, 1.0, 1.0);
        let lamps = LightSwitching { lights: SwitchedLights::Lamps, ..sharp };
        check(lamps, 7.0, 1.0, 0.2);
        let slow = LightSwitching { ramp_secs: 2.0, off_gain: 0.0, ..sharp };
        check(slow, 7.0, 0.5, 0.5);
        check(slow, 13.0, 0.5, 0.5);
        for (on_share, gain) in [(1.0, 1.0), (0.0, 0.2)] {
            check(LightSwitching { on_share, ..sharp }, 3.0, gain, gain);
        }
    }
}
