//! One label a pixel: background, moving or shadow.
//!
//! The blurred difference, the background and the mixture's verdict flow in; labels flow out. Every pixel is judged
//! by itself; what its neighbours make of it comes later.
//!
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 4 and 5.
//! `[C03]` Cucchiara, Grana, Piccardi and Prati 2003, Detecting moving objects, ghosts, and shadows in video streams:
//! a shadow darkens a pixel and leaves its chromaticity.

use super::difference::Difference;
use super::{BACKGROUND, MOVING, SHADOW};
use crate::config::{MixtureRule, SegmentSettings};
use crate::frame::{Mask, Plane, YuvImage};
use rayon::prelude::*;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 16;

/// Pixels to either side whose verdicts are counted with a pixel's own: a 5 x 5 majority, as a median filter takes.
const REACH: usize = 2;

/// The mixture's verdict after the majority; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Majority {
    /// Verdicts against the background within `REACH` columns.
    sums: Vec<u8>,
}

impl Majority {
    pub(super) fn compute(&mut self, unmatched: &Mask) {
        let width = unmatched.width as usize;
        self.sums.resize(unmatched.data.len(), 0);
        let rows = self.sums.par_chunks_mut(width).zip(unmatched.data.par_chunks(width));
        rows.with_min_len(MIN_ROWS).for_each(|(sums, verdicts)| {
            for (x, sum) in sums.iter_mut().enumerate() {
                let window = &verdicts[x.saturating_sub(REACH)..(x + REACH + 1).min(width)];
                *sum = window.iter().map(|verdict| verdict & 1).sum();
            }
        });
    }

    /// Whether most verdicts around column `x` of row `y` are against the background; beyond the border there are
    /// none.
    fn is_unmatched(&self, x: usize, y: usize, width: usize) -> bool {
        let height = self.sums.len() / width;
        let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
        let n_columns = (x + REACH + 1).min(width) - x.saturating_sub(REACH);
        let n_verdicts = rows.len() * n_columns;
        let n_against: usize = rows.map(|row| usize::from(self.sums[row * width + x])).sum();
        2 * n_against > n_verdicts
    }
}

/// Labels every pixel; `labels` has the frame's size.
pub(super) fn label(
    labels: &mut [u8],
    difference: &Difference,
    majority: &Majority,
    frame: &YuvImage,
    background: [Plane<'_>; 3],
    settings: &SegmentSettings,
) {
    let width = frame.width() as usize;
    let delta = settings.delta as f32;
    let shadows = ShadowTest::new(frame, settings);
    labels.par_chunks_mut(width).enumerate().with_min_len(MIN_ROWS).for_each(|(y, labels)| {
        let norms = &difference.norm()[y * width..(y + 1) * width];
        for (x, (label, norm)) in labels.iter_mut().zip(norms).enumerate() {
            let differs = *norm > delta;
            let is_foreground = match settings.mixture {
                MixtureRule::Ignore => differs,
                MixtureRule::Require => differs && majority.is_unmatched(x, y, width),
                MixtureRule::Add => differs || majority.is_unmatched(x, y, width),
            };
            *label = match (is_foreground, &shadows) {
                (false, _) => BACKGROUND,
                (true, Some(test)) if test.is_shadow(difference, background, x, y) => SHADOW,
                (true, _) => MOVING,
            };
        }
    });
}

/// Whether a pixel is its background in shadow (the test of `[C03]`, on YUV).
///
/// A shadow scales linear light, and so, up to the transfer curve's toe, the coded channels too, all by one factor;
/// luma and chroma, being linear in the coded channels, are scaled by it as well. The factor is taken from luma, and
/// chroma must follow it.
struct ShadowTest {
    black_code: f32,
    darkest: f32,
    /// Chroma codes.
    tolerance: f32,
}

impl ShadowTest {
    /// `None` when the settings look for no shadows.
    fn new(frame: &YuvImage, settings: &SegmentSettings) -> Option<Self> {
        if settings.shadow_darkest >= 1.0 {
            return None;
        }
        let (black_code, _luma_codes, chroma_codes) = frame.range().luma_offset_luma_scale_chroma_scale();
        let tolerance = settings.shadow_chroma as f32 * chroma_codes;
        Some(Self { black_code, darkest: settings.shadow_darkest as f32, tolerance })
    }

    fn is_shadow(&self, difference: &Difference, background: [Plane<'_>; 3], x: usize, y: usize) -> bool {
        let code = |plane: usize, x: usize, y: usize| f32::from(background[plane].row(y as u32)[x]);
        let luma = code(0, x, y) - self.black_code;
        let change = difference.row(0, y)[x];
        // Compared without dividing, so a black background needs no case of its own: nothing is its shadow.
        if change >= 0.0 || luma + change < self.darkest * luma || luma <= 0.0 {
            return false;
        }
        let (x, y) = (x / 2, y / 2);
        [1, 2].into_iter().all(|plane| {
            let expected = change / luma * (code(plane, x, y) - 128.0);
            (difference.row(plane, y)[x] - expected).abs() <= self.tolerance
        })
    }
}
