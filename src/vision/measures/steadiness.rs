//! How steady pictures are over time, where the truth stands still.

use crate::frame::{Mask, RgbImage};

/// By no more codes than this the truth may change where it stands still: what rounding does.
const STILL: u8 = 2;

/// Pictures of one view, and what they should be, one after the other.
#[derive(Clone, Debug, Default)]
pub struct Steadiness {
    n_pictures: u32,
    /// By pixel and channel: the mean so far, and the sum of squares off it (Welford 1962).
    moments: Vec<[f32; 2]>,
    /// By pixel and channel: the least and greatest code of the truth.
    truths: Vec<[u8; 2]>,
    /// By pixel, whether it counts in every picture.
    counts: Vec<bool>,
}

impl Steadiness {
    /// Adds the next picture; `part` is 0 where it does not count.
    ///
    /// **Cost** 11 bytes and a few operations a pixel's channel.
    ///
    /// # Panics
    /// When sizes differ from each other or from those before.
    pub fn add(&mut self, picture: &RgbImage, truth: &RgbImage, part: Option<&Mask>) {
        let n_pixels = picture.width as usize * picture.height as usize;
        if self.n_pictures == 0 {
            self.moments = vec![[0.0; 2]; 3 * n_pixels];
            self.truths = vec![[u8::MAX, 0]; 3 * n_pixels];
            self.counts = vec![true; n_pixels];
        }
        let sizes = [picture.data.len(), truth.data.len(), 3 * self.counts.len()];
        assert_eq!(sizes, [3 * n_pixels; 3], "pictures of one view are compared");
        self.n_pictures += 1;
        let n = self.n_pictures as f32;
        for ((code, true_code), ([mean, squares], [low, high])) in
            picture.data.iter().zip(&truth.data).zip(self.moments.iter_mut().zip(&mut self.truths))
        {
            let code = f32::from(*code);
            let off = code - *mean;
            *mean += off / n;
            *squares += off * (code - *mean);
            (*low, *high) = ((*low).min(*true_code), (*high).max(*true_code));
        }
        if let Some(part) = part {
            assert_eq!(part.data.len(), n_pixels, "a part of the view");
            self.counts.iter_mut().zip(part.data.iter()).for_each(|(counts, value)| *counts &= *value != 0);
        }
    }

    /// Temporal flicker: the variance over time of the pictures' codes at places where the truth stands still, the mean over them and the
    /// channels, 8-bit codes squared. `None` of fewer than two pictures, or where nothing stands still.
    #[must_use]
    pub fn variance(&self) -> Option<f64> {
        if self.n_pictures < 2 {
            return None;
        }
        let (mut sum, mut n) = (0.0, 0_u64);
        for (pixel, _) in self.counts.iter().enumerate().filter(|(_, counts)| **counts) {
            let of = 3 * pixel..3 * pixel + 3;
            if self.truths[of.clone()].iter().all(|[low, high]| high - low <= STILL) {
                sum += self.moments[of].iter().map(|[_, squares]| f64::from(*squares)).sum::<f64>();
                n += 3;
            }
        }
        (n > 0).then(|| sum / (f64::from(self.n_pictures - 1) * n as f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(codes: [u8; 4]) -> RgbImage {
        RgbImage { width: 2, height: 2, data: codes.into_iter().flat_map(|code| [code; 3]).collect() }
    }

    #[test]
    fn what_changes_where_the_truth_stands_still_is_flicker() {
        let mut steadiness = Steadiness::default();
        assert_eq!(steadiness.variance(), None);
        // Of four places one is steady, one flickers, one moves in truth too, and one does not count in the second picture.
        let part = Mask { width: 2, height: 2, data: vec![255, 255, 255, 0].into() };
        steadiness.add(&picture([10, 20, 30, 0]), &picture([10, 10, 10, 10]), None);
        assert_eq!(steadiness.variance(), None);
        steadiness.add(&picture([10, 26, 90, 9]), &picture([11, 9, 90, 10]), Some(&part));
        steadiness.add(&picture([10, 23, 30, 99]), &picture([9, 10, 10, 10]), None);
        // Of 20, 26 and 23 the variance is 9, of 10, 10 and 10 it is 0.
        assert!((steadiness.variance().unwrap() - 4.5).abs() < 1e-6, "{:?}", steadiness.variance());
        let mut moving = Steadiness::default();
        moving.add(&picture([0; 4]), &picture([0; 4]), None);
        moving.add(&picture([0; 4]), &picture([9; 4]), None);
        assert_eq!(moving.variance(), None);
    }
}
