//! A model as bytes: versioned, compressed, exact.
//!
//! Owns the layout below. A model read back equals the one written to the bit, so a restart goes on as if there had
//! been none. Bytes that are damaged, cut short or foreign are an error, never a model.
//!
//! ```text
//! "vfgm", version (u8)                                   5 bytes, then one zstd frame with its checksum:
//! width, height (u32), matrix, range, modes (u8), changed frames (u32), changed seconds (f64), time (i64), n (u64)
//! live modes of every pixel (u8 each), row-major
//! weights, mean Y, mean U, mean V, variances of the live modes (f32)
//! ```
//! All numbers are little-endian. The five fields are stored one after the other, each as four planes of bytes, the
//! lowest bytes first: alike bytes side by side compress, whole floats hardly do.

use super::light::LightChange;
use super::pixel::{Mode, WEIGHT_FLOOR, stands_before};
use super::{BackgroundError, Format, GaussianMixture};
use crate::clock::Timestamp;
use crate::config::BackgroundSettings;
use crate::frame::{ColorMatrix, ColorRange};
use std::io::{Read, Write};

const MAGIC: [u8; 4] = *b"vfgm";
const VERSION: u8 = 1;
const HEADER_LEN: usize = 4 + 4 + 3 + 4 + 8 + 8 + 8;
const FIELDS: usize = 5;

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
        let counts: Vec<u8> = self.modes.chunks_exact(self.n_modes).map(live_modes).collect();
        encoder.write_all(&counts)?;
        for field in 0..FIELDS {
            let values: Vec<[u8; 4]> = self
                .modes
                .iter()
                .filter(|mode| mode.weight > 0.0)
                .map(|mode| field_of(mode, field).to_le_bytes())
                .collect();
            for byte in 0..4 {
                let plane: Vec<u8> = values.iter().map(|value| value[byte]).collect();
                encoder.write_all(&plane)?;
            }
        }
        Ok(encoder.finish()?)
    }

    fn header(&self, time: Timestamp) -> Vec<u8> {
        let mut header = Vec::with_capacity(HEADER_LEN);
        header.extend(self.format.width.to_le_bytes());
        header.extend(self.format.height.to_le_bytes());
        header.extend([matrix_code(self.format.matrix), range_code(self.format.range), self.n_modes as u8]);
        header.extend(self.change.n_frames.to_le_bytes());
        header.extend(self.change.secs.to_le_bytes());
        header.extend(time.as_nanos().to_le_bytes());
        header.extend(self.n_frames.to_le_bytes());
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
        let (mut model, time) = read_header(&header, settings, &mut decoder)?;
        let mut end = [0; 1];
        if decoder.read(&mut end)? != 0 || !decoder.finish().is_empty() {
            return Err(refused("bytes follow its end"));
        }
        model.paint_all();
        Ok((model, time))
    }
}

/// Reads what the header says and then, only as far as the bytes really go, the modes it promises.
fn read_header(
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
    let format = Format { width, height, matrix: matrix_of(matrix)?, range: range_of(range)? };
    let n_pixels = u64::from(width) * u64::from(height);
    let counts = read_bytes(payload, n_pixels, "mode counts")?;
    if counts.iter().any(|count| usize::from(*count) > n_modes || (*count == 0) != (n_frames == 0)) {
        return Err(refused("a pixel has no modes or too many"));
    }
    let n_live: u64 = counts.iter().map(|count| u64::from(*count)).sum();
    let mut live = vec![Mode::EMPTY; n_live as usize];
    for field in 0..FIELDS {
        let planes = read_bytes(payload, 4 * n_live, "modes")?;
        for (i, mode) in live.iter_mut().enumerate() {
            let byte = |plane: usize| planes[plane * n_live as usize + i];
            *field_of_mut(mode, field) = f32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]);
        }
    }
    let mut model = GaussianMixture::new(settings, format);
    model.n_frames = n_frames;
    model.change = change;
    let mut live = live.as_slice();
    for (modes, count) in model.modes.chunks_exact_mut(n_modes).zip(counts) {
        let (of_pixel, rest) = live.split_at(usize::from(count));
        check_pixel(of_pixel)?;
        modes[..of_pixel.len()].copy_from_slice(of_pixel);
        live = rest;
    }
    Ok((model, time))
}

/// What every model that was learned keeps to; damage that a checksum was computed over does not.
fn check_pixel(modes: &[Mode]) -> Result<(), BackgroundError> {
    let mut sum = 0.0;
    for mode in modes {
        let weight_is_sound = mode.weight >= 0.5 * WEIGHT_FLOOR && mode.weight <= 1.001;
        let mean_is_sound = mode.mean.iter().all(|mean| (-0.01..=255.01).contains(mean));
        let variance_is_sound = mode.variance > 0.0 && mode.variance <= 1e6;
        if !(weight_is_sound && mean_is_sound && variance_is_sound) {
            return Err(refused("a mode has a weight, mean or variance that no model has"));
        }
        sum += mode.weight;
    }
    if !modes.is_empty() && (sum - 1.0).abs() > 1e-3 {
        return Err(refused(format!("weights of a pixel sum to {sum}")));
    }
    if modes.windows(2).any(|pair| stands_before(&pair[1], &pair[0])) {
        return Err(refused("modes of a pixel are out of order"));
    }
    Ok(())
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

fn live_modes(modes: &[Mode]) -> u8 {
    modes.iter().filter(|mode| mode.weight > 0.0).count() as u8
}

const fn field_of(mode: &Mode, field: usize) -> f32 {
    match field {
        0 => mode.weight,
        1..=3 => mode.mean[field - 1],
        _ => mode.variance,
    }
}

const fn field_of_mut(mode: &mut Mode, field: usize) -> &mut f32 {
    match field {
        0 => &mut mode.weight,
        1..=3 => &mut mode.mean[field - 1],
        _ => &mut mode.variance,
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
            assert_eq!(restored.modes, model.modes);
            assert_eq!((restored.n_frames, restored.format), (model.n_frames, model.format));
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
            assert_eq!(restored.modes, model.modes);
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
                    assert_eq!(model.modes, learned(6, 4).modes, "byte {at} bit {bit}");
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
        check("no modes", &|payload| payload[HEADER_LEN] = 0);
        check("a byte more", &|payload| payload.push(0));
        // The highest byte of every field's floats: NaN, infinity or negative.
        let n_live = (whole.len() - HEADER_LEN - 4) / 20;
        for field in 0..FIELDS {
            for (high, next) in [(0x7f, 0xff), (0x7f, 0x80), (0xc2, 0x80)] {
                check(&format!("field {field} {high:x}"), &|payload| {
                    let planes = HEADER_LEN + 4 + field * 4 * n_live;
                    payload[planes + 3 * n_live] = high;
                    payload[planes + 2 * n_live] = next;
                });
            }
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
