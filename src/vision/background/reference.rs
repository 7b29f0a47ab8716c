//! The scalar twin: exact, readable, f32; what the form in use is held to. Every pixel in its turn, in full.
//!
//! Chroma is read at its own resolution: the three channels of a luma pixel are its Y and the U and V of the 2 x 2
//! block that it lies in. The background picture's chroma is the mean of the block's four first modes.

use super::pace::Pace;
use super::pixel::{Mode, Parameters, classify, learn};
use super::rows::BandRows;
use super::{BackgroundError, Format, Update};
use crate::config::BackgroundSettings;
use crate::frame::{Mask, Plane, YuvImage, YuvLayout};
use rayon::prelude::*;

/// Row pairs that one thread takes at least: fewer would cost more to hand out than to do.
const MIN_PAIRS: usize = 8;

/// Every pixel's background as a mixture of Gaussians, with the picture of its means.
///
/// **Cost** 20 bytes a pixel and mode. The modes of a pixel lie together (an array of structures in one vector):
/// every step reads all of a pixel's modes at once and no step one field of many pixels, so this is one cache line
/// or two a pixel instead of one a field.
#[derive(Debug)]
pub struct ReferenceMixture {
    format: Format,
    layout: YuvLayout,
    /// Modes a pixel, 1 to 5.
    n_modes: usize,
    parameters: Parameters,
    pace: Pace,
    /// `height * width * n_modes`, row-major.
    modes: Vec<Mode>,
    foreground: Mask,
    /// The first modes' means, packed I420.
    background: Vec<u8>,
}

/// Two rows of luma (one at the foot of an odd height) and their row of chroma.
struct Band<'a> {
    modes: &'a mut [Mode],
    foreground: &'a mut [u8],
    luma: &'a mut [u8],
    u: &'a mut [u8],
    v: &'a mut [u8],
}

impl ReferenceMixture {
    /// A model that has seen nothing, for pictures of `format`.
    ///
    /// # Panics
    /// When `format` has no pixels, which no picture has.
    #[must_use]
    pub fn new(settings: &BackgroundSettings, format: Format) -> Self {
        assert!(format.width > 0 && format.height > 0, "a picture has pixels");
        let n_modes = settings.modes.clamp(1, 5);
        let layout = YuvLayout::packed(format.width, format.height);
        let n_pixels = format.width as usize * format.height as usize;
        let mut background = vec![128; YuvLayout::packed_len(format.width, format.height)];
        background[..n_pixels].fill(0);
        Self {
            format,
            layout,
            n_modes,
            parameters: Parameters::new(settings),
            pace: Pace::new(settings),
            modes: vec![Mode::EMPTY; n_pixels * n_modes],
            foreground: Mask::filled(format.width, format.height, 0),
            background,
        }
    }

    /// What the model is for.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// Frames learned since the start or since the last change of the light; 0 for a model that knows nothing.
    #[must_use]
    pub const fn n_frames(&self) -> u64 {
        self.pace.n_frames
    }

    /// Bytes that the model and its pictures take.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        self.modes.len() * size_of::<Mode>() + self.foreground.data.len() + self.background.len()
    }

    /// Which pixels of the frame last given to [`update`](Self::update) or [`classify`](Self::classify) matched no
    /// background mode: 255 there, 0 elsewhere. The second detector.
    #[must_use]
    pub const fn foreground(&self) -> &Mask {
        &self.foreground
    }

    /// Y, U and V of the background picture: the mean of every pixel's first mode, rounded.
    #[must_use]
    pub fn background_planes(&self) -> [Plane<'_>; 3] {
        [0, 1, 2].map(|index| self.layout.plane(&self.background, index))
    }

    /// A copy of the background picture, to be shared.
    #[must_use]
    pub fn background_picture(&self) -> YuvImage {
        YuvImage::new(self.layout, self.format.matrix, self.format.range, self.background.clone())
            .expect("the planes were laid out for this size")
    }

    /// Learns `image`, seen `dt_secs` after the frame before it.
    ///
    /// `dt_secs` is held to 0 ..= the setting `max_step_secs`, so that a gap in the stream does not wipe the model;
    /// NaN counts as 0. A step of 0 teaches nothing, but for the very first frame. Allocates nothing.
    ///
    /// # Errors
    /// [`BackgroundError::Mismatch`] when `image` is of another size or colour; the model is then unchanged.
    pub fn update(&mut self, image: &YuvImage, dt_secs: f64) -> Result<Update, BackgroundError> {
        self.check_format(image)?;
        let step_secs = self.pace.step_secs(dt_secs);
        let learning_rate = self.pace.begin(step_secs);
        let rate = learning_rate as f32;
        let n_foreground = match self.n_modes {
            1 => self.learn_all::<1>(image, rate),
            2 => self.learn_all::<2>(image, rate),
            3 => self.learn_all::<3>(image, rate),
            4 => self.learn_all::<4>(image, rate),
            _ => self.learn_all::<5>(image, rate),
        };
        let foreground_share = n_foreground as f64 / self.foreground.data.len() as f64;
        let light_changed = self.pace.end(foreground_share, step_secs);
        Ok(Update { learning_rate, foreground_share, visited_share: 1.0, light_changed })
    }

    /// Finds the foreground of `image` and learns nothing. Allocates nothing.
    ///
    /// # Errors
    /// [`BackgroundError::Mismatch`] when `image` is of another size or colour.
    pub fn classify(&mut self, image: &YuvImage) -> Result<(), BackgroundError> {
        self.check_format(image)?;
        match self.n_modes {
            1 => self.classify_all::<1>(image),
            2 => self.classify_all::<2>(image),
            3 => self.classify_all::<3>(image),
            4 => self.classify_all::<4>(image),
            _ => self.classify_all::<5>(image),
        }
        Ok(())
    }

    fn check_format(&self, image: &YuvImage) -> Result<(), BackgroundError> {
        let picture = Format::of(image);
        if picture == self.format {
            return Ok(());
        }
        Err(BackgroundError::Mismatch { model: self.format, picture })
    }

    fn learn_all<const K: usize>(&mut self, image: &YuvImage, rate: f32) -> u64 {
        let parameters = &self.parameters;
        bands(&self.layout, K, &mut self.modes, &mut self.foreground.data, &mut self.background)
            .map(|(pair_idx, mut band)| {
                let rows = BandRows::of(image, pair_idx);
                let modes = std::mem::take(&mut band.modes).as_chunks_mut::<K>().0;
                let width = rows.width();
                for (luma, (modes, foreground)) in
                    rows.luma().zip(modes.chunks_mut(width).zip(band.foreground.chunks_mut(width)))
                {
                    for (x, (modes, foreground)) in modes.iter_mut().zip(foreground).enumerate() {
                        let is_background = learn(modes, rows.sample(luma, x), parameters, rate);
                        *foreground = 255 * u8::from(!is_background);
                    }
                }
                paint(modes, width, &mut band);
                band.foreground.iter().map(|foreground| u64::from(foreground & 1)).sum::<u64>()
            })
            .sum()
    }

    fn classify_all<const K: usize>(&mut self, image: &YuvImage) {
        let parameters = &self.parameters;
        bands(&self.layout, K, &mut self.modes, &mut self.foreground.data, &mut self.background).for_each(
            |(pair_idx, band)| {
                let rows = BandRows::of(image, pair_idx);
                let modes = band.modes.as_chunks::<K>().0;
                let width = rows.width();
                for (luma, (modes, foreground)) in
                    rows.luma().zip(modes.chunks(width).zip(band.foreground.chunks_mut(width)))
                {
                    for (x, (modes, foreground)) in modes.iter().zip(foreground).enumerate() {
                        let is_background = classify(modes, rows.sample(luma, x), parameters);
                        *foreground = 255 * u8::from(!is_background);
                    }
                }
            },
        );
    }
}

/// Cuts state and outputs into row pairs that threads can take. What a band computes depends on nothing outside it,
/// so the result is the same to the bit whatever the number of threads.
fn bands<'a>(
    layout: &YuvLayout,
    n_modes: usize,
    modes: &'a mut [Mode],
    foreground: &'a mut [u8],
    background: &'a mut [u8],
) -> impl IndexedParallelIterator<Item = (usize, Band<'a>)> {
    let pair = 2 * layout.width as usize;
    let chroma_width = layout.chroma_width() as usize;
    let [luma, u, v] = layout.split_mut(background);
    modes
        .par_chunks_mut(pair * n_modes)
        .zip(foreground.par_chunks_mut(pair))
        .zip(luma.par_chunks_mut(pair))
        .zip(u.par_chunks_mut(chroma_width))
        .zip(v.par_chunks_mut(chroma_width))
        .map(|((((modes, foreground), luma), u), v)| Band { modes, foreground, luma, u, v })
        .enumerate()
        .with_min_len(MIN_PAIRS)
}

/// Writes the first modes' means of a row pair.
fn paint<const K: usize>(modes: &[[Mode; K]], width: usize, band: &mut Band<'_>) {
    for (value, modes) in band.luma.iter_mut().zip(modes) {
        *value = rounded(modes[0].mean[0]);
    }
    let (first, second) = modes.split_at(width);
    for (i, (u, v)) in band.u.iter_mut().zip(band.v.iter_mut()).enumerate() {
        let (mut sum_u, mut sum_v, mut n) = (0.0, 0.0, 0.0);
        for row in [first, second] {
            for modes in row.iter().skip(2 * i).take(2) {
                sum_u += modes[0].mean[1];
                sum_v += modes[0].mean[2];
                n += 1.0;
            }
        }
        (*u, *v) = (rounded(sum_u / n), rounded(sum_v / n));
    }
}

/// A cast from float saturates, so no mean leaves the range of a byte.
fn rounded(mean: f32) -> u8 {
    (mean + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::pictures::{filled, format, padded_with_a_light_pixel, share};
    use crate::frame::{ColorMatrix, ColorRange};

    /// A picture whose every sample is a hash of its place and `seed`, around `level`.
    fn noisy(width: u32, height: u32, level: u8, seed: u32) -> YuvImage {
        let data: Vec<u8> = (0..YuvLayout::packed_len(width, height) as u32)
            .map(|i| {
                let hash = (i ^ seed.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
                level + ((hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35) >> 29) as u8
            })
            .collect();
        YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data)
            .unwrap()
    }

    fn model(width: u32, height: u32) -> ReferenceMixture {
        ReferenceMixture::new(&BackgroundSettings::default(), format(width, height))
    }

    #[test]
    fn still_picture_becomes_the_background_at_any_size() {
        for (width, height) in [(1, 1), (1, 7), (7, 1), (2, 2), (5, 3), (64, 35)] {
            let mut model = model(width, height);
            let image = noisy(width, height, 90, 3);
            for _ in 0..3 {
                model.update(&image, 0.04).unwrap();
            }
            assert_eq!(share(model.foreground()), 0.0, "{width} x {height}");
            let picture = model.background_picture();
            for index in 0..3 {
                let (got, want) = (picture.plane(index), image.plane(index));
                for y in 0..want.height {
                    assert_eq!(got.row(y), want.row(y), "{width} x {height}, plane {index}, row {y}");
                }
            }
        }
    }

    #[test]
    fn what_was_not_there_is_foreground_and_padding_of_rows_is_not_read() {
        let mut model = model(16, 8);
        for _ in 0..50 {
            model.update(&filled(16, 8, [100, 128, 128]), 0.1).unwrap();
        }
        let image = padded_with_a_light_pixel();
        let update = model.update(&image, 0.1).unwrap();
        assert_eq!(model.foreground().get(5, 2), 255);
        assert_eq!(update.foreground_share, 1.0 / 128.0);
    }

    #[test]
    fn learning_rate_follows_time_not_frames() {
        let settings = BackgroundSettings { tau_secs: 1.0, ..BackgroundSettings::default() };
        let learned = |dt_secs: f64, n: usize| {
            let mut model = ReferenceMixture::new(&settings, format(2, 2));
            for _ in 0..10_000 {
                model.update(&filled(2, 2, [50, 128, 128]), dt_secs).unwrap();
            }
            let mut rate = 0.0;
            for _ in 0..n {
                rate = model.update(&filled(2, 2, [200, 128, 128]), dt_secs).unwrap().learning_rate;
            }
            (model.modes[..3].iter().find(|mode| mode.mean[0] > 100.0).unwrap().weight, rate)
        };
        let (slow, slow_rate) = learned(0.2, 3);
        let (fast, fast_rate) = learned(0.02, 30);
        assert!((slow - fast).abs() < 1e-4, "{slow} {fast}");
        assert!((slow_rate - (1.0 - (-0.2_f64).exp())).abs() < 1e-12, "{slow_rate}");
        assert!((fast_rate - (1.0 - (-0.02_f64).exp())).abs() < 1e-12, "{fast_rate}");
        assert!((f64::from(slow) - (1.0 - (-0.6_f64).exp())).abs() < 1e-4, "{slow}");
    }

    #[test]
    fn gap_of_an_hour_does_not_wipe_the_model() {
        let mut model = model(4, 4);
        for _ in 0..1000 {
            model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
        }
        for gap in [3600.0, 1e300, f64::INFINITY] {
            let update = model.update(&filled(4, 4, [200, 120, 130]), gap).unwrap();
            assert!(update.learning_rate < 0.01, "{gap}: {update:?}");
            assert_eq!(model.background_planes()[0].row(0), [80; 4]);
        }
        model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
        assert_eq!(share(model.foreground()), 0.0);
    }

    #[test]
    fn step_without_time_teaches_nothing_but_for_the_first() {
        let mut model = model(2, 2);
        for dt_secs in [0.0, -5.0, f64::NAN, f64::NEG_INFINITY] {
            model.update(&filled(2, 2, [80, 128, 128]), dt_secs).unwrap();
            assert_eq!(model.n_frames(), 1, "{dt_secs}");
        }
        let update = model.update(&filled(2, 2, [200, 128, 128]), f64::NAN).unwrap();
        assert_eq!((update.learning_rate, update.foreground_share), (0.0, 1.0));
        assert_eq!(model.background_planes()[0].row(0), [80; 2]);
    }

    #[test]
    fn picture_of_another_kind_is_refused_and_changes_nothing() {
        let mut model = model(4, 4);
        model.update(&filled(4, 4, [80, 128, 128]), 0.1).unwrap();
        let others = [
            filled(4, 6, [80, 128, 128]),
            YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt709, ColorRange::Limited),
            YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt601, ColorRange::Full),
        ];
        for other in others {
            let before = model.modes.clone();
            let error = model.update(&other, 0.1).unwrap_err();
            assert!(matches!(error, BackgroundError::Mismatch { .. }), "{error}");
            assert!(model.classify(&other).is_err());
            assert_eq!((model.modes.clone(), model.n_frames()), (before, 1));
        }
    }

    #[test]
    fn light_switched_on_is_told_and_learned_within_frames() {
        let mut model = model(32, 24);
        for seed in 0..200 {
            assert!(!model.update(&noisy(32, 24, 40, seed), 0.1).unwrap().light_changed);
        }
        let mut changed_at = Vec::new();
        for frame in 0..40 {
            if model.update(&noisy(32, 24, 150, frame), 0.1).unwrap().light_changed {
                changed_at.push(frame);
            }
        }
        assert_eq!(changed_at, [5]);
        assert!(share(model.foreground()) < 0.01, "{}", share(model.foreground()));
        assert!(model.background_planes()[0].row(0).iter().all(|y| y.abs_diff(153) <= 4));
        // The old light is remembered for a while: going back is no surprise.
        model.update(&noisy(32, 24, 40, 1), 0.1).unwrap();
        assert!(model.modes.iter().any(|mode| mode.weight > 0.01 && mode.mean[0] < 60.0));
    }

    #[test]
    fn result_is_the_same_to_the_bit_whatever_the_number_of_threads() {
        let run = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| {
                let mut model = model(67, 131);
                for seed in 0..20 {
                    model.update(&noisy(67, 131, 60 + 7 * (seed % 3) as u8, seed), 0.1).unwrap();
                }
                (model.modes, model.background, model.foreground)
            })
        };
        assert!(run(1) == run(4));
    }

    #[test]
    fn classifying_agrees_with_learning_and_changes_no_mode() {
        let mut model = model(33, 17);
        for seed in 0..20 {
            model.update(&noisy(33, 17, 60 + 12 * (seed % 3) as u8, seed), 0.1).unwrap();
        }
        let image = noisy(33, 17, 75, 99);
        let before = model.modes.clone();
        model.classify(&image).unwrap();
        let classified = model.foreground().clone();
        assert_eq!(model.modes, before);
        model.update(&image, 0.1).unwrap();
        assert_eq!(*model.foreground(), classified);
        assert!((0.001..0.999).contains(&share(&classified)), "the test picture has both");
    }

    #[test]
    fn every_number_of_modes_works() {
        for modes in 1..=5 {
            let settings = BackgroundSettings { modes, ..BackgroundSettings::default() };
            let mut model = ReferenceMixture::new(&settings, format(6, 5));
            for frame in 0..300 {
                let level = [60, 100, 140, 180, 220][frame % 5];
                model.update(&filled(6, 5, [level, 128, 128]), 0.1).unwrap();
            }
            let n_live = model.modes[..modes].iter().filter(|mode| mode.weight > 0.0).count();
            assert_eq!(n_live, modes);
        }
    }
}
