//! Tells pictures of the shape that was calibrated from others: other sizes of the same shape are scaled, others are stretched.

/// Largest difference between ratios of width to height of pictures that count as of one shape, as a share.
const SAME_SHAPE: f64 = 0.01;

/// Tells whether pictures of `size_px` columns and rows have another ratio of the two than the picture of `calibrated_px`, by more
/// than a hundredth: what such a camera shows is stretched onto the scene.
#[must_use]
pub fn is_stretched(calibrated_px: (u32, u32), size_px: (u32, u32)) -> bool {
    let ratio = |(width, height): (u32, u32)| f64::from(width.max(1)) / f64::from(height.max(1));
    (ratio(size_px) / ratio(calibrated_px) - 1.0).abs() > SAME_SHAPE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_sizes_of_one_shape_are_not_stretched() {
        for size_px in [(1920, 1080), (640, 360), (1920, 1088), (640, 363), (640, 357), (16, 9)] {
            assert!(!is_stretched((1920, 1080), size_px), "{size_px:?}");
        }
        for size_px in [(360, 640), (960, 1080), (640, 480), (640, 364), (640, 356), (1, 0)] {
            assert!(is_stretched((1920, 1080), size_px), "{size_px:?}");
        }
    }
}
