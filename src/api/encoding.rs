//! How long pictures take to encode, by what the last ones took: a deadline leaves room for it.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use videofields_vision::encode::PictureFormat;

/// Encodings that are remembered of each format.
const N_RECENT: usize = 33;

/// What a megapixel is taken to need before any was timed, milliseconds: JPEG, PNG.
const FIRST_MS: [f64; 2] = [15.0, 90.0];

/// Every picture takes as long as one of so many megapixels more.
const FIXED_MEGAPIXELS: f64 = 0.02;

/// Milliseconds a megapixel of the last encodings, by format.
#[derive(Debug, Default)]
pub(super) struct EncodingPace(Mutex<[VecDeque<f64>; 2]>);

const fn place(format: PictureFormat) -> usize {
    match format {
        PictureFormat::Jpeg => 0,
        PictureFormat::Png => 1,
    }
}

fn megapixels((width_px, height_px): (u32, u32)) -> f64 {
    (f64::from(width_px) * f64::from(height_px)).mul_add(1e-6, FIXED_MEGAPIXELS)
}

impl EncodingPace {
    /// Notes what an encoding took.
    pub(super) fn note(&self, format: PictureFormat, size_px: (u32, u32), took: Duration) {
        let mut recent = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let recent = &mut recent[place(format)];
        if recent.len() == N_RECENT {
            recent.pop_front();
        }
        recent.push_back(took.as_secs_f64() * 1e3 / megapixels(size_px));
    }

    /// What an encoding takes, three times of four no more: whole milliseconds, so that alike requests stay alike.
    pub(super) fn expected(&self, format: PictureFormat, size_px: (u32, u32)) -> Duration {
        let recent = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut sorted: Vec<f64> = recent[place(format)].iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let rate_ms = sorted.get(sorted.len() * 3 / 4).copied().unwrap_or(FIRST_MS[place(format)]);
        Duration::from_millis((rate_ms * megapixels(size_px)).ceil() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_is_expected_by_size_as_it_was_and_one_slow_one_moves_nothing() {
        let pace = EncodingPace::default();
        let size = (1000, 980);
        assert_eq!(pace.expected(PictureFormat::Jpeg, size), Duration::from_millis(15));
        for _ in 0..8 {
            pace.note(PictureFormat::Jpeg, size, Duration::from_millis(7));
        }
        pace.note(PictureFormat::Jpeg, size, Duration::from_secs(5));
        assert_eq!(pace.expected(PictureFormat::Jpeg, size), Duration::from_millis(7));
        assert_eq!(pace.expected(PictureFormat::Jpeg, (0, 0)), Duration::from_millis(1));
        assert!(pace.expected(PictureFormat::Png, size) > Duration::from_millis(50), "formats differ");
        assert!(pace.expected(PictureFormat::Png, (65_535, 65_535)) > Duration::from_secs(60));
    }
}
