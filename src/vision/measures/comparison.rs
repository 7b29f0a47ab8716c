//! How far a picture is from its reference: RMSE, PSNR and SSIM.
//!
//! Two pictures (and a mask that says where to look) go in, figures come out. Knows nothing of who made either.

use super::similarity::{self, SimilarityRows};
use crate::error::ErrorKind;
use crate::frame::{Mask, RgbImage};
use serde::Serialize;

/// How far a picture is from its reference, over all pixels or those of a mask.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Root of the mean squared difference of the 8-bit sRGB codes over all three channels, 0 to 255.
    pub rmse: f64,
    /// Peak signal-to-noise ratio for a peak of 255, decibels; `None` (null) where nothing differs.
    pub psnr_db: Option<f64>,
    /// Mean structural similarity, -1 to 1; 1 where nothing differs.
    pub ssim: f64,
    /// Pixels compared.
    pub n_pixels: u64,
}

/// Why two pictures cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccuracyError {
    /// Pictures or mask of different sizes.
    #[error("{what} has {} x {} pixels, the reference {} x {}", size.0, size.1, reference.0, reference.1)]
    Size {
        /// `picture` or `mask`.
        what: &'static str,
        /// Its columns and rows.
        size: (u32, u32),
        /// The reference's columns and rows.
        reference: (u32, u32),
    },
    /// Smaller than the window of the structural similarity.
    #[error("pictures must have at least 7 pixels each way, got {width} x {height}")]
    TooSmall {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Bytes that do not make up the picture.
    #[error("{what} needs {needed} bytes for its size, got {available}")]
    Length {
        /// `reference`, `picture` or `mask`.
        what: &'static str,
        /// Bytes that its size takes.
        needed: u64,
        /// Bytes that it has.
        available: u64,
    },
    /// A mask that selects nothing.
    #[error("the mask selects no pixel: every value is 0")]
    EmptyMask,
}

impl AccuracyError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        ErrorKind::Invalid
    }
}

/// Compares `picture` with `reference`, where `mask` is not 0 if there is one.
///
/// The figures are those of scikit-image for 8-bit pictures: `peak_signal_noise_ratio` and `structural_similarity`
/// with `channel_axis=2` and its defaults. Without a mask the similarity is the mean over the pixels whose whole
/// window lies in the picture; with one, the mean of the similarity map (`full=True`) over the mask's pixels.
///
/// **Cost** linear in the pixels.
///
/// # Errors
/// When sizes differ, a side is below 7 pixels, a picture's bytes do not fit its size, or the mask selects nothing.
pub fn compare(
    reference: &RgbImage,
    picture: &RgbImage,
    mask: Option<&Mask>,
) -> Result<Comparison, AccuracyError> {
    check(reference, picture, mask)?;
    let width = reference.width as usize;
    let (mut n_pixels, mut squares) = (0_u64, 0_u64);
    let (mut similarity, mut n_similarities) = (0.0, 0_u64);
    let mut rows = SimilarityRows::new(reference, picture);
    for y in 0..reference.height as usize {
        let span = y * width * 3..(y + 1) * width * 3;
        let pixels = reference.data[span.clone()].chunks_exact(3).zip(picture.data[span].chunks_exact(3));
        let similarities = rows.next_row();
        for (x, ((a, b), pixel_similarity)) in pixels.zip(similarities).enumerate() {
            let is_selected = mask.is_none_or(|mask| mask.data[y * width + x] != 0);
            if is_selected {
                n_pixels += 1;
                squares += a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum::<u64>();
            }
            if is_selected && (mask.is_some() || rows_within(reference, x, y)) {
                similarity += pixel_similarity;
                n_similarities += 1;
            }
        }
    }
    if n_pixels == 0 {
        return Err(AccuracyError::EmptyMask);
    }
    let mean_square = squares as f64 / (3 * n_pixels) as f64;
    Ok(Comparison {
        rmse: mean_square.sqrt(),
        psnr_db: (squares > 0).then(|| 10.0 * (255.0 * 255.0 / mean_square).log10()),
        ssim: similarity / n_similarities as f64,
        n_pixels,
    })
}

/// Whether the whole window around a pixel lies in the picture.
fn rows_within(picture: &RgbImage, x: usize, y: usize) -> bool {
    let within = |at: usize, count: u32| {
        (similarity::WINDOW_HALF..count as usize - similarity::WINDOW_HALF).contains(&at)
    };
    within(x, picture.width) && within(y, picture.height)
}

fn check(reference: &RgbImage, picture: &RgbImage, mask: Option<&Mask>) -> Result<(), AccuracyError> {
    let size = (reference.width, reference.height);
    let mut parts = vec![
        ("reference", size, reference.data.len(), 3),
        ("picture", (picture.width, picture.height), picture.data.len(), 3),
    ];
    parts.extend(mask.map(|mask| ("mask", (mask.width, mask.height), mask.data.len(), 1)));
    for (what, part_size, available, bytes_each) in parts {
        if part_size != size {
            return Err(AccuracyError::Size { what, size: part_size, reference: size });
        }
        let needed = (u64::from(size.0) * u64::from(size.1)).saturating_mul(bytes_each);
        if available as u64 != needed {
            return Err(AccuracyError::Length { what, needed, available: available as u64 });
        }
    }
    let least = 2 * similarity::WINDOW_HALF as u32 + 1;
    if size.0 < least || size.1 < least {
        return Err(AccuracyError::TooSmall { width: size.0, height: size.1 });
    }
    Ok(())
}
