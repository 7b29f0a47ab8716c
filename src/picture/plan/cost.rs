//! What settings cost on the machine at hand, and what error they leave: the measured tables that deciding how
//! exact a picture shall be takes.
//!
//! Plain data: `accuracy` measures it, the store keeps it as JSON, the API shows it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use videofields_vision::measures::quantile;

/// Version of [`CostTable`] as JSON; tables of another version are measured anew.
pub const COST_TABLE_VERSION: u32 = 3;

/// Median and quartiles of something measured several times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Half of the values lie at or below it.
    pub median: f64,
    /// A quarter of the values lies at or below it.
    pub lower_quartile: f64,
    /// Three quarters of the values lie at or below it.
    pub upper_quartile: f64,
    /// How many values there were.
    pub count: u64,
}

impl Spread {
    /// The spread of `values`, interpolated linearly between neighbours (type 7 of Hyndman and Fan 1996, Sample
    /// quantiles in statistical packages); `None` without any, or where one is not finite.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| quantile(&sorted, share);
        let (median, lower_quartile, upper_quartile) = (at(0.5), at(0.25), at(0.75));
        Some(Self { median, lower_quartile, upper_quartile, count: sorted.len() as u64 })
    }

    /// The spread of the sum of parts whose own spreads are known, each part `times` as often: exact for the median
    /// and quartiles only where the parts rise and fall together, and never too narrow otherwise.
    #[must_use]
    pub fn plus(self, other: Self, times: f64) -> Self {
        Self {
            median: other.median.mul_add(times, self.median),
            lower_quartile: other.lower_quartile.mul_add(times, self.lower_quartile),
            upper_quartile: other.upper_quartile.mul_add(times, self.upper_quartile),
            count: self.count.min(other.count),
        }
    }
}

/// What one setting of one stage costs, and what error it leaves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostRow {
    /// The stage: `segmentation`, `map`, `surfaces`, `entities` or `pipeline`.
    pub stage: String,
    /// What of the stage was set, such as `resolution`.
    pub knob: String,
    /// What it was set to, such as `half`.
    pub value: String,
    /// Whether this is what is used where nothing else is said.
    pub is_default: bool,
    /// Milliseconds for one unit of the stage's work.
    pub time_ms: Spread,
    /// Bytes that the stage's result or state takes.
    pub memory_bytes: u64,
    /// The stage's own error, 0 for none; `None` where there is no truth to judge by.
    pub error: Option<f64>,
    /// Everything measured, by name; units stand in the names.
    pub measures: BTreeMap<String, f64>,
}

/// The machine on which something was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of its processor, as the system names it.
    pub processor: String,
    /// Processors that this process may use.
    pub n_processors: usize,
    /// The GPU adapter's name.
    pub adapter: String,
    /// This program's version.
    pub version: String,
    /// `release`, or `debug` with its checks.
    pub build: String,
}

/// Measured costs and errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostTable {
    /// [`COST_TABLE_VERSION`].
    pub version: u32,
    /// On which machine.
    pub machine: Machine,
    /// On which world or scene.
    pub subject: String,
    /// When the measuring ended, RFC 3339.
    pub measured_at: String,
    /// What it took, seconds.
    pub took_secs: f64,
    /// Whether everything was measured within its time.
    pub is_complete: bool,
    /// One row a setting.
    pub rows: Vec<CostRow>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_those_of_hyndman_and_fan_s_type_7() {
        // As numpy.percentile gives them.
        let check = |values: &[f64], expected: [f64; 3]| {
            let found = Spread::of(values).unwrap();
            assert_eq!([found.lower_quartile, found.median, found.upper_quartile], expected, "{values:?}");
            assert_eq!(found.count, values.len() as u64);
        };
        check(&[4.0], [4.0; 3]);
        check(&[2.0, 1.0], [1.25, 1.5, 1.75]);
        check(&[3.0, 1.0, 2.0], [1.5, 2.0, 2.5]);
        check(&[10.0, 0.0, 30.0, 20.0, 40.0], [10.0, 20.0, 30.0]);
        check(&[1.0, 2.0, 3.0, 4.0], [1.75, 2.5, 3.25]);
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(Spread::of(&[1.0, f64::NAN]), None);
    }

    #[test]
    fn parts_add_up() {
        let part =
            |median| Spread { median, lower_quartile: median - 1.0, upper_quartile: median + 2.0, count: 5 };
        assert_eq!(
            part(4.0).plus(part(3.0), 2.0),
            Spread { median: 10.0, lower_quartile: 7.0, upper_quartile: 16.0, count: 5 }
        );
    }
}
