//! A model as bytes: versioned, compressed, exact.
//!
//! Owns the layout below. A model read back goes on to the bit as the one written would have, so a restart changes
//! nothing. Bytes that are damaged, cut short or foreign are an error, never a model.
//!
//! ```text
//! "vfgm", version (u8)                                   5 bytes, then one zstd frame with its checksum:
//! width, height (u32), matrix, range, modes (u8), changed frames (u32), changed seconds (f64), time (i64),
//! frames learned (u64), steps ever (u64), decay (f64), variance step (f32)
//! which modes but the first of every pixel are live (u8 each, one bit a mode), row-major
//! if frames were learned: mean Y, mean U, mean V, variance of the first modes (i16)
//! mean Y, mean U, mean V, variance (i16), weight (f32) of the live others, pixel by pixel
//! ```
//! All numbers are little-endian. Fields are stored one after the other, each as planes of bytes, the lowest bytes
//! first: alike bytes side by side compress, whole numbers hardly do.

use super::kernel::variance_step;
use super::light::LightChange;
use super::tile::{MEAN_STEPS, TILE, TileGaussians, VARIANCE_STEPS};
use super::{BackgroundError, Format, GaussianMixture};
use crate::clock::Timestamp;
use crate::config::BackgroundSettings;
use crate::frame::{ColorMatrix, ColorRange};
use std::io::{Read, Write};

const MAGIC: [u8; 4] = *b"vfgm";
const VERSION: u8 = 2;
const HEADER_LEN: usize = 4 + 4 + 3 + 4 + 8 + 8 + 8 + 8 + 8 + 4;

/// Means and the variance.
const FIELDS: usize = 4;

/// The fastest level: a model is mostly noise in its low bytes, which no level shrinks.
const LEVEL: i32 = 1;

impl GaussianMixture {
    /// The model as bytes, with the time of the frame it learned last.
    ///
    /// # Errors
    /// When compression fails.
    pub fn encode(&self, time: Timestamp) -> Result<Vec<u8>, BackgroundError> {
        let mut out = Vec::from(MAGIC);
        out.push(VERSION);
        let mut encoder = zstd::Encoder::new(out, LEVEL)?;
        encoder.include_checksum(true)?;
        encoder.write_all(&self.header(time))?;
        let live: Vec<u8> = self.places().map(|place| self.live_others(place)).collect();
        encoder.write_all(&live)?;
        if self.n_frames() == 0 {
            return Ok(encoder.finish()?);
        }
        for field in 0..FIELDS {
            let values = self.places().map(|(tile, i)| field_of(&self.first[tile], field)[i].to_le_bytes());
            write_planes(&mut encoder, values)?;
        }
        let n_others = self.n_modes - 1;
        let others = || {
            self.places().zip(&live).flat_map(move |((tile, i), live)| {
                let is_live = move |j: &usize| live >> j & 1 == 1;
                (0..n_others).filter(is_live).map(move |j| (&self.others[tile * n_others + j], i))
            })
        };
        for field in 0..FIELDS {
            let values = others().map(|(mode, i)| field_of(&mode.gaussians, field)[i].to_le_bytes());
            write_planes(&mut encoder, values)?;
        }
        write_planes(&mut encoder, others().map(|(mode, i)| mode.weights[i].to_le_bytes()))?;
        Ok(encoder.finish()?)
    }

    /// Tile and place in it of every pixel, row-major.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (width, tiles_per_row) = (self.format.width as usize, self.tiles_per_row);
        (0..self.format.height as usize)
            .flat_map(move |y| (0..width).map(move |x| (y * tiles_per_row + x / TILE, x % TILE)))
    }

    fn live_others(&self, (tile, i): (usize, usize)) -> u8 {
        let n_others = self.n_modes - 1;
        let modes = &self.others[tile * n_others..(tile + 1) * n_others];
        modes.iter().enumerate().map(|(j, mode)| u8::from(mode.weights[i] > 0.0) << j).sum()
    }

    fn header(&self, time: Timestamp) -> Vec<u8> {
        let mut header = Vec::with_capacity(HEADER_LEN);
        header.extend(self.format.width.to_le_bytes());
        header.extend(self.format.height.to_le_bytes());
        header.extend([matrix_code(self.format.matrix), range_code(self.format.range), self.n_modes as u8]);
        header.extend(self.pace.change.n_frames.to_le_bytes());
        header.extend(self.pace.change.secs.to_le_bytes());
        header.extend(time.as_nanos().to_le_bytes());
        header.extend(self.pace.n_frames.to_le_bytes());
        header.extend(self.n_steps.to_le_bytes());
        header.extend(self.decay.to_le_bytes());
        header.extend(variance_step(&self.parameters).to_le_bytes());
        header
    }

    /// Reads a model and the time of the frame it learned last. Thresholds and rates come from `settings`, so they
    /// may have changed since; the number of modes may not.
    ///
    /// # Errors
    /// When `bytes` are no whole, sound checkpoint of this version, or have another number of modes than
    /// `settings`.
    pub fn decode(bytes: &[u8], settings: &BackgroundSettings) -> Result<(Self, Timestamp), BackgroundError> {
        let payload =
            bytes.strip_prefix(&MAGIC).ok_or_else(|| refused("its first bytes are not \"vfgm\""))?;
        let (version, payload) =
            payload.split_first().ok_or_else(|| refused("it ends before its version"))?;
        if *version != VERSION {
            return Err(refused(format!("its version is {version}, this build reads {VERSION}")));
        }
        let mut decoder = zstd::Decoder::with_buffer(payload)?.single_frame();
        let mut header = [0; HEADER_LEN];
        decoder.read_exact(&mut header)?;
        let (mut model, time) = read_model(&header, settings, &mut decoder)?;
        let mut end = [0; 1];
        if decoder.read(&mut end)? != 0 || !decoder.finish().is_empty() {
            return Err(refused("bytes follow its end"));
        }
        model.find_rests();
        model.paint_all();
        Ok((model, time))
    }

    /// Beyond the right border, the last pixel of every row is repeated: as if it had been learned there too.
    fn repeat_last_pixels(&mut self) {
        let n_inside = (self.format.width as usize - 1) % TILE + 1;
        let n_others = self.n_modes - 1;
        for row in 0..self.first.len() / self.tiles_per_row {
            let tile = (row + 1) * self.tiles_per_row - 1;
            repeat_last(&mut self.first[tile], n_inside);
            for mode in &mut self.others[tile * n_others..(tile + 1) * n_others] {
                repeat_last(&mut mode.gaussians, n_inside);
                let last = mode.weights[n_inside - 1];
                mode.weights[n_inside..].fill(last);
            }
        }
    }
}

fn repeat_last(gaussians: &mut TileGaussians, n_inside: usize) {
    for field in 0..FIELDS {
        let values = field_of_mut(gaussians, field);
        let last = values[n_inside - 1];
        values[n_inside..].fill(last);
    }
}

/// Writes numbers as planes of bytes, the lowest bytes first.
fn write_planes<const N: usize>(
    out: &mut impl Write,
    values: impl Iterator<Item = [u8; N]>,
) -> std::io::Result<()> {
    let values: Vec<[u8; N]> = values.collect();
    (0..N).try_for_each(|byte| {
        let plane: Vec<u8> = values.iter().map(|value| value[byte]).collect();
        out.write_all(&plane)
    })
}

/// Reads numbers that were written as planes, only as far as the bytes really go.
fn read_planes<const N: usize, R: Read>(
    payload: &mut R,
    n_values: usize,
    what: &str,
) -> Result<impl Iterator<Item = [u8; N]> + use<N, R>, BackgroundError> {
    let planes = read_bytes(payload, (N * n_values) as u64, what)?;
    Ok((0..n_values).map(move |i| std::array::from_fn(|byte| planes[byte * n_values + i])))
}

/// Reads what the header says and then, only as far as the bytes really go, the modes it promises.
fn read_model(
    header: &[u8; HEADER_LEN],
    settings: &BackgroundSettings,
    payload: &mut impl Read,
) -> Result<(GaussianMixture, Timestamp), BackgroundError> {
    let mut fields = Fields(header);
    let [width, height] = [u32::from_le_bytes(fields.take()), u32::from_le_bytes(fields.take())];
    let [matrix, range, n_modes] = fields.take();
    let change =
        LightChange { n_frames: u32::from_le_bytes(fields.take()), secs: f64::from_le_bytes(fields.take()) };
    let time = Timestamp::from_nanos(i64::from_le_bytes(fields.take()));
    let n_frames = u64::from_le_bytes(fields.take());
    let n_steps = u64::from_le_bytes(fields.take());
    let decay = f64::from_le_bytes(fields.take());
    let step = f32::from_le_bytes(fields.take());
    let n_modes = usize::from(n_modes);
    let expected = settings.modes.clamp(1, 5);
    if n_modes != expected {
        return Err(BackgroundError::Modes { found: n_modes, expected });
    }
    if width == 0 || height == 0 {
        return Err(refused(format!("its size is {width} x {height}")));
    }
    if !(change.secs.is_finite() && change.secs >= 0.0) {
        return Err(refused("its seconds of change are not a time"));
    }
    if !(decay > 0.0 && decay <= 1.0) {
        return Err(refused("its decay is not a share"));
    }
    if !(step.is_finite() && step > 0.0) {
        return Err(refused("its variance step is no number above 0"));
    }
    let format = Format { width, height, matrix: matrix_of(matrix)?, range: range_of(range)? };
    // Before a model of that size is made, its first plane must be there.
    let live = read_bytes(payload, u64::from(width) * u64::from(height), "live modes")?;
    let mut model = GaussianMixture::new(settings, format);
    model.pace.n_frames = n_frames;
    model.pace.change = change;
    model.n_steps = n_steps;
    model.decay = decay;
    if n_frames > 0 {
        let variance_factor = step / variance_step(&model.parameters);
        read_modes(&mut model, &live, variance_factor, payload)?;
        model.repeat_last_pixels();
    }
    Ok((model, time))
}

/// Reads every pixel's modes. Variances are counted in other steps now, if the settings changed: `variance_factor`.
fn read_modes(
    model: &mut GaussianMixture,
    live: &[u8],
    variance_factor: f32,
    payload: &mut impl Read,
) -> Result<(), BackgroundError> {
    let n_others = model.n_modes - 1;
    if live.iter().any(|live| live >> n_others != 0) {
        return Err(refused("a pixel has too many modes"));
    }
    for field in 0..FIELDS {
        let values = read_planes(payload, live.len(), "first modes")?.map(i16::from_le_bytes);
        for ((tile, i), value) in model.places().zip(values) {
            field_of_mut(&mut model.first[tile], field)[i] = sound(field, value, variance_factor)?;
        }
    }
    let n_live = live.iter().map(|live| live.count_ones() as usize).sum();
    let slots: Vec<(usize, usize)> = model
        .places()
        .zip(live)
        .flat_map(|((tile, i), live)| {
            let is_live = move |j: &usize| live >> j & 1 == 1;
            (0..n_others).filter(is_live).map(move |j| (tile * n_others + j, i))
        })
        .collect();
    for field in 0..FIELDS {
        let values = read_planes(payload, n_live, "modes")?.map(i16::from_le_bytes);
        for (&(mode, i), value) in slots.iter().zip(values) {
            let gaussians = &mut model.others[mode].gaussians;
            field_of_mut(gaussians, field)[i] = sound(field, value, variance_factor)?;
        }
    }
    let weights = read_planes(payload, n_live, "weights")?.map(f32::from_le_bytes);
    for (&(mode, i), weight) in slots.iter().zip(weights) {
        if !(weight.is_finite() && weight > 0.0) {
            return Err(refused("a mode has a weight that no model has"));
        }
        model.others[mode].weights[i] = weight;
    }
    let decay = model.decay as f32;
    for (tile, i) in model.places() {
        let modes = &model.others[tile * n_others..(tile + 1) * n_others];
        let rest: f32 = modes.iter().map(|mode| mode.weights[i]).sum();
        if rest * decay > 1.001 {
            return Err(refused(format!("weights of a pixel sum to more than 1: {}", rest * decay)));
        }
    }
    Ok(())
}

/// A field's value if a model can have it; damage that a checksum was computed over makes others.
fn sound(field: usize, value: i16, variance_factor: f32) -> Result<i16, BackgroundError> {
    if field + 1 == FIELDS {
        if value <= 0 || f32::from(value) > VARIANCE_STEPS + 1.0 {
            return Err(refused("a mode has a variance that no model has"));
        }
        return Ok((f32::from(value) * variance_factor).clamp(1.0, VARIANCE_STEPS + 0.5) as i16);
    }
    if value < 0 || f32::from(value) >= 255.0 * MEAN_STEPS + 1.0 {
        return Err(refused("a mode has a mean that no model has"));
    }
    Ok(value)
}

/// Reads exactly `len` bytes, growing only as they come, so that a false size costs no memory.
fn read_bytes(payload: &mut impl Read, len: u64, what: &str) -> Result<Vec<u8>, BackgroundError> {
    let mut bytes = Vec::new();
    payload.take(len).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == len {
        return Ok(bytes);
    }
    Err(refused(format!("it ends within its {what}: {} of {len} bytes", bytes.len())))
}

const fn field_of(gaussians: &TileGaussians, field: usize) -> &[i16; TILE] {
    match field {
        0..=2 => &gaussians.means[field],
        _ => &gaussians.variances,
    }
}

const fn field_of_mut(gaussians: &mut TileGaussians, field: usize) -> &mut [i16; TILE] {
    match field {
        0..=2 => &mut gaussians.means[field],
        _ => &mut gaussians.variances,
    }
}

/// Takes fixed-size fields off the front of a header.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk().expect("the header is as long as its fields");
        self.0 = rest;
        *field
    }
}

const fn matrix_code(matrix: ColorMatrix) -> u8 {
    match matrix {
        ColorMatrix::Bt601 => 0,
        ColorMatrix::Bt709 => 1,
        ColorMatrix::Bt2020 => 2,
    }
}

fn matrix_of(code: u8) -> Result<ColorMatrix, BackgroundError> {
    match code {
        0 => Ok(ColorMatrix::Bt601),
        1 => Ok(ColorMatrix::Bt709),
        2 => Ok(ColorMatrix::Bt2020),
        _ => Err(refused(format!("its colour matrix is {code}"))),
    }
}

const fn range_code(range: ColorRange) -> u8 {
    match range {
        ColorRange::Limited => 0,
        ColorRange::Full => 1,
    }
}

fn range_of(code: u8) -> Result<ColorRange, BackgroundError> {
    match code {
        0 => Ok(ColorRange::Limited),
        1 => Ok(ColorRange::Full),
        _ => Err(refused(format!("its colour range is {code}"))),
    }
}

fn refused(reason: impl Into<String>) -> BackgroundError {
    BackgroundError::Checkpoint { reason: reason.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::YuvImage;
    use proptest::prelude::*;

    fn image(width: u32, height: u32, luma: u8) -> YuvImage {
        YuvImage::filled(width, height, [luma, 120, 140], ColorMatrix::Bt709, ColorRange::Full)
    }

    fn learned(width: u32, height: u32) -> GaussianMixture {
        let format = Format::of(&image(width, height, 0));
        let mut model = GaussianMixture::new(&BackgroundSettings::default(), format);
        for frame in 0..40 {
            model.update(&image(width, height, [50, 53, 200][frame % 3]), 0.1).unwrap();
        }
        model
    }

    fn decode(bytes: &[u8]) -> Result<(GaussianMixture, Timestamp), BackgroundError> {
        GaussianMixture::decode(bytes, &BackgroundSettings::default())
    }

    /// A sound envelope around a payload that may not be.
    fn sealed(payload: &[u8]) -> Vec<u8> {
        let mut encoder = zstd::Encoder::new([&MAGIC[..], &[VERSION]].concat(), LEVEL).unwrap();
        encoder.include_checksum(true).unwrap();
        encoder.write_all(payload).unwrap();
        encoder.finish().unwrap()
    }

    fn opened(bytes: &[u8]) -> Vec<u8> {
        zstd::decode_all(&bytes[5..]).unwrap()
    }

    #[test]
    fn model_read_back_is_the_same_to_the_bit_and_goes_on_alike() {
        let time = Timestamp::from_nanos(1_790_000_000_123_456_789);
        for (width, height) in [(1, 1), (5, 3), (40, 30)] {
            let mut model = learned(width, height);
            let (mut restored, restored_time) = decode(&model.encode(time).unwrap()).unwrap();
            assert_eq!(restored_time, time);
            assert_eq!(restored.encode(time).unwrap(), model.encode(time).unwrap());
            assert_eq!((restored.n_frames(), restored.format), (model.n_frames(), model.format));
            for plane in 0..3 {
                let [got, want] = [&restored, &model].map(|model| model.background_planes()[plane].data);
                assert_eq!(got, want);
            }
            for luma in [90, 52, 201, 90, 90, 90, 90, 90, 90] {
                let updates = [&mut restored, &mut model]
                    .map(|model| model.update(&image(width, height, luma), 0.1).unwrap());
                assert_eq!(updates[0], updates[1]);
                assert_eq!(restored.foreground(), model.foreground());
            }
            assert_eq!(restored.encode(time).unwrap(), model.encode(time).unwrap());
        }
    }

    #[test]
    fn another_greatest_variance_takes_the_variances_along() {
        let model = learned(40, 3);
        let settings = BackgroundSettings { variance_max: 150.0, ..BackgroundSettings::default() };
        let (other, _) =
            GaussianMixture::decode(&model.encode(Timestamp::default()).unwrap(), &settings).unwrap();
        for (a, b) in model.first.iter().zip(&other.first) {
            for (a, b) in a.variances.iter().zip(&b.variances) {
                assert!((f32::from(*a) * 0.5 - f32::from(*b)).abs() <= 1.0, "{a} {b}");
            }
        }
    }

    #[test]
    fn model_without_a_frame_is_kept_too() {
        let format = Format::of(&image(3, 3, 0));
        let model = GaussianMixture::new(&BackgroundSettings::default(), format);
        let bytes = model.encode(Timestamp::default()).unwrap();
        assert_eq!(decode(&bytes).unwrap().0.n_frames(), 0);
    }

    #[test]
    fn another_number_of_modes_is_told() {
        let bytes = learned(4, 4).encode(Timestamp::default()).unwrap();
        let settings = BackgroundSettings { modes: 5, ..BackgroundSettings::default() };
        let error = GaussianMixture::decode(&bytes, &settings).unwrap_err();
        assert_eq!(error.to_string(), "the checkpoint has 3 modes a pixel, the settings ask for 5");
    }

    #[test]
    fn every_cut_and_every_flipped_bit_is_refused() {
        let bytes = learned(6, 4).encode(Timestamp::default()).unwrap();
        for len in 0..bytes.len() {
            assert!(decode(&bytes[..len]).is_err(), "cut to {len}");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                if let Ok((model, _)) = decode(&damaged) {
                    // Some bits of zstd's own header carry no meaning; the model must then be the same.
                    assert_eq!(model.encode(Timestamp::default()).unwrap(), bytes, "byte {at} bit {bit}");
                }
            }
        }
        assert!(decode(&[bytes.clone(), vec![0]].concat()).is_err(), "a byte too many");
    }

    #[test]
    fn sealed_nonsense_is_refused() {
        let whole = opened(&learned(2, 2).encode(Timestamp::default()).unwrap());
        let check = |what: &str, change: &dyn Fn(&mut Vec<u8>)| {
            let mut payload = whole.clone();
            change(&mut payload);
            let error = decode(&sealed(&payload)).expect_err(what);
            assert_eq!(error.kind(), crate::error::ErrorKind::Invalid, "{what}: {error}");
        };
        assert!(decode(&sealed(&whole)).is_ok());
        check("no width", &|payload| payload[0..4].fill(0));
        check("a width that no memory holds", &|payload| payload[0..8].fill(0xff));
        check("an unknown matrix", &|payload| payload[8] = 9);
        check("an unknown range", &|payload| payload[9] = 9);
        check("endless change", &|payload| payload[15..23].copy_from_slice(&f64::NAN.to_le_bytes()));
        check("no frames but modes", &|payload| payload[31..39].fill(0));
        check("too many modes", &|payload| payload[HEADER_LEN] = 4);
        check("fewer modes than follow", &|payload| payload[HEADER_LEN] = 0);
        check("no decay", &|payload| payload[47..55].fill(0));
        check("a decay that grows", &|payload| payload[47..55].copy_from_slice(&1.5_f64.to_le_bytes()));
        check("no variance step", &|payload| payload[55..59].fill(0));
        check("a byte more", &|payload| payload.push(0));
        let (n_pixels, n_live) = (4, (whole.len() - HEADER_LEN - 4 * 9) / 12);
        assert!(n_live > 0, "the test model has more than first modes");
        // The highest byte of every field: a negative number, or one beyond every mean and variance.
        let others = HEADER_LEN + n_pixels * 9;
        let planes = [(HEADER_LEN + n_pixels, n_pixels), (others, n_live)]
            .into_iter()
            .flat_map(|(start, n)| (0..FIELDS).map(move |field| (start + field * 2 * n, n)));
        for (plane, n) in planes {
            for beyond in [i16::MAX, -1] {
                check(&format!("{beyond} at {plane}"), &|payload| {
                    [payload[plane], payload[plane + n]] = beyond.to_le_bytes();
                });
            }
        }
        // NaN, infinity, a negative weight, and one above all others.
        let weights = others + FIELDS * 2 * n_live;
        for (high, next) in [(0x7f, 0xff), (0x7f, 0x80), (0xc2, 0x80), (0x42, 0x80)] {
            check(&format!("weight {high:x}"), &|payload| {
                payload[weights + 3 * n_live] = high;
                payload[weights + 2 * n_live] = next;
            });
        }
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(decode(&bytes).is_err());
            prop_assert!(decode(&sealed(&bytes)).is_err());
        }
    }
}
