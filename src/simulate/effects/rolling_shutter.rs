//! Rolling shutter: the sensor reads its rows one after the other.
//!
//! Settings and the time of a row. A frame's capture instant is that of its middle row.

use super::ranges::Ranges;
use super::{EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the readout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RollingShutter {
    /// Seconds from the reading of the first row to that of the last, 0 to 1; below 0, down to -1, the last row is
    /// read first (a camera mounted upside down). Default 0.03.
    pub readout_secs: f64,
}

impl Default for RollingShutter {
    fn default() -> Self {
        Self { readout_secs: 0.03 }
    }
}

impl RollingShutter {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("readout_secs", self.readout_secs, -1.0..=1.0);
    }

    /// When row `row` of `n_rows` is read, seconds from the capture instant.
    #[must_use]
    pub fn offset_secs(&self, row: u32, n_rows: u32, tally: &Tally<'_>) -> f64 {
        tally.enter(EffectKind::RollingShutter);
        ((f64::from(row) + 0.5) / f64::from(n_rows.max(1)) - 0.5) * self.readout_secs
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn rows_are_read_in_order_around_the_capture_instant() {
        let shutter = RollingShutter { readout_secs: 0.02 };
        let entries = Entries::default();
        let times: Vec<f64> = (0..101).map(|row| shutter.offset_secs(row, 101, &entries.tally())).collect();
        assert!(times.windows(2).all(|pair| pair[1] > pair[0]));
        assert!(times[50].abs() < 1e-15);
        assert!((times[100] - times[0] - 0.02 * 100.0 / 101.0).abs() < 1e-12);
        assert_eq!(entries.count(EffectKind::RollingShutter), 101);
    }
}
