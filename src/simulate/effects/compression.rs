//! Compression: a codec that has little to spend.
//!
//! Settings of the VP8 encoder in place of the simulator's own, which keep every frame close to what the sensor gave;
//! the encoder is `video`'s.

use super::ranges::Ranges;
use super::{EffectKind, Tally};
use serde::{Deserialize, Serialize};

/// Settings of the codec.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Compression {
    /// VP8's quantiser index for every frame, 0 (best) to 63; the least where a bitrate is given. Default 45.
    pub quantizer: u32,
    /// What the stream may take, thousand bits a second, 10 to 100000; the quantiser then varies between its index
    /// and 63. Default: none, one quantiser for all frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bitrate_kbit_per_sec: Option<u32>,
    /// Frames from one key frame to the next at most, 1 to 10000. Default 120.
    pub key_frame_distance: u32,
}

impl Default for Compression {
    fn default() -> Self {
        Self { quantizer: 45, bitrate_kbit_per_sec: None, key_frame_distance: 120 }
    }
}

impl Compression {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.count("quantizer", self.quantizer, 0..=63);
        if let Some(rate) = self.bitrate_kbit_per_sec {
            ranges.count("bitrate_kbit_per_sec", rate, 10..=100_000);
        }
        ranges.count("key_frame_distance", self.key_frame_distance, 1..=10_000);
    }

    /// The least and the largest quantiser index that the encoder may choose.
    #[must_use]
    pub fn quantizers(&self, tally: &Tally<'_>) -> (u32, u32) {
        tally.enter(EffectKind::Compression);
        (self.quantizer, if self.bitrate_kbit_per_sec.is_some() { 63 } else { self.quantizer })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn a_bitrate_lets_the_quantizer_vary() {
        let entries = Entries::default();
        let fixed = Compression { quantizer: 30, ..Compression::default() };
        assert_eq!(fixed.quantizers(&entries.tally()), (30, 30));
        let spent = Compression { bitrate_kbit_per_sec: Some(200), ..fixed };
        assert_eq!(spent.quantizers(&entries.tally()), (30, 63));
        assert_eq!(entries.count(EffectKind::Compression), 2);
    }
}
