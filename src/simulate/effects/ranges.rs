//! Holds settings to their ranges; what is outside becomes a fault with its place.

use std::ops::RangeInclusive;
use videofields_vision::error::{Fault, pointer_to};

/// Checks the values of one effect.
pub(super) struct Ranges<'a> {
    place: &'static str,
    faults: &'a mut Vec<Fault>,
}

impl<'a> Ranges<'a> {
    pub(super) const fn new(place: &'static str, faults: &'a mut Vec<Fault>) -> Self {
        Self { place, faults }
    }

    /// Refuses a number outside `allowed`; NaN is outside everything.
    pub(super) fn number(&mut self, key: &str, value: f64, allowed: RangeInclusive<f64>) {
        self.number_at(&pointer_to(self.place, key), value, allowed);
    }

    /// Refuses a count outside `allowed`.
    pub(super) fn count(&mut self, key: &str, value: u32, allowed: RangeInclusive<u32>) {
        self.number(key, f64::from(value), f64::from(*allowed.start())..=f64::from(*allowed.end()));
    }

    /// Refuses what is wrong for another reason than its range.
    pub(super) fn hold(&mut self, key: &str, is_right: impl FnOnce() -> bool, message: &str) {
        if !is_right() {
            self.faults.push(Fault::new(pointer_to(self.place, key), message));
        }
    }

    /// Refuses a wind out of its range: metres a second towards east and north, up to 50 each way.
    pub(super) fn wind(&mut self, key: &str, wind_m_per_sec: [f64; 2]) {
        for (i, value) in wind_m_per_sec.into_iter().enumerate() {
            self.number_at(&format!("{}/{i}", pointer_to(self.place, key)), value, -50.0..=50.0);
        }
    }

    fn number_at(&mut self, place: &str, value: f64, allowed: RangeInclusive<f64>) {
        if !allowed.contains(&value) {
            let message = format!("must be {} to {}, got {value}", allowed.start(), allowed.end());
            self.faults.push(Fault::new(place, message));
        }
    }
}
