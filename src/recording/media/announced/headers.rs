//! The size in the header of each codec, read from its first bit to the size and no further.
//!
//! Formulas: ITU-T H.264 7.3.2.1, H.265 7.3.2.2, RFC 6386 9.1 (VP8), the VP9 bitstream specification 6.2, the AV1
//! specification 5.5, ISO/IEC 14496-2 6.2.3 (MPEG-4 part 2), yuv4mpeg(5) of mjpegtools.

use super::{Announced, Size, between_start_codes};

/// The size in a sequence parameter set of H.264, cut to nothing.
pub(super) fn h264(bytes: &[u8]) -> Option<Size> {
    let mut bits = Bits::new(bytes);
    let profile = bits.read(8)?;
    bits.skip(16)?;
    bits.exponential()?;
    // All profiles but the oldest three tell their chroma.
    if [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135].contains(&profile) {
        let chroma = bits.exponential()?;
        if chroma == 3 {
            bits.skip(1)?;
        }
        bits.exponential()?;
        bits.exponential()?;
        bits.skip(1)?;
        if bits.read(1)? == 1 {
            for list in 0..if chroma == 3 { 12 } else { 8 } {
                skip_scaling_list(&mut bits, if list < 6 { 16 } else { 64 })?;
            }
        }
    }
    bits.exponential()?;
    match bits.exponential()? {
        0 => {
            bits.exponential()?;
        }
        1 => {
            bits.skip(1)?;
            bits.exponential()?;
            bits.exponential()?;
            for _ in 0..bits.exponential()?.min(255) {
                bits.exponential()?;
            }
        }
        _ => {}
    }
    bits.exponential()?;
    bits.skip(1)?;
    let width = bits.exponential()?.checked_add(1)?.checked_mul(16)?;
    let units = bits.exponential()?.checked_add(1)?;
    let is_in_frames = bits.read(1)?;
    Some((width, units.checked_mul(16)?.checked_mul(2 - is_in_frames)?))
}

fn skip_scaling_list(bits: &mut Bits<'_>, n_entries: u32) -> Option<()> {
    if bits.read(1)? == 0 {
        return Some(());
    }
    let (mut last, mut next) = (8_i64, 8_i64);
    for _ in 0..n_entries {
        if next != 0 {
            let coded = i64::from(bits.exponential()?);
            let delta = if coded % 2 == 1 { (coded + 1) / 2 } else { -coded / 2 };
            next = (last + delta).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// The size in a sequence parameter set of H.265, cut to nothing.
pub(super) fn h265(bytes: &[u8]) -> Option<Size> {
    let mut bits = Bits::new(bytes);
    bits.skip(4)?;
    let n_layers = bits.read(3)?;
    bits.skip(1 + 96)?;
    let present: Vec<(u32, u32)> =
        (0..n_layers).map(|_| Some((bits.read(1)?, bits.read(1)?))).collect::<Option<_>>()?;
    if n_layers > 0 {
        bits.skip(2 * (8 - n_layers as usize))?;
    }
    for (has_profile, has_level) in present {
        bits.skip(88 * has_profile as usize + 8 * has_level as usize)?;
    }
    bits.exponential()?;
    if bits.exponential()? == 3 {
        bits.skip(1)?;
    }
    Some((bits.exponential()?, bits.exponential()?))
}

/// The size of a key frame of VP8; other frames say none.
pub(super) fn vp8(bytes: &[u8]) -> Announced {
    match bytes {
        [first, _, _, 0x9d, 0x01, 0x2a, w0, w1, h0, h1, ..] if first & 1 == 0 => {
            let side = |low, high| u32::from(u16::from_le_bytes([low, high]) & 0x3fff);
            Announced::Size((side(*w0, *w1), side(*h0, *h1)))
        }
        [first, ..] if first & 1 == 0 => Announced::Unreadable,
        _ => Announced::Nothing,
    }
}

/// The largest size of the frames in a buffer of VP9.
pub(super) fn vp9(bytes: &[u8]) -> Announced {
    let frames = vp9_frames(bytes);
    let sizes = frames.iter().filter(|frame| !frame.is_empty()).map(|frame| {
        vp9_frame(frame)
            .map_or(Announced::Unreadable, |size| size.map_or(Announced::Nothing, Announced::Size))
    });
    sizes.fold(Announced::Nothing, Announced::max)
}

/// The frames of a superframe, or the one frame that there is (annex B).
fn vp9_frames(bytes: &[u8]) -> Vec<&[u8]> {
    let index = || {
        let marker = *bytes.last()?;
        if marker & 0xe0 != 0xc0 {
            return None;
        }
        let (n_frames, n_length) = (usize::from(marker & 7) + 1, usize::from(marker >> 3 & 3) + 1);
        let n_index = 2 + n_frames * n_length;
        let (mut frames, index) = bytes.split_at_checked(bytes.len().checked_sub(n_index)?)?;
        if index.first() != Some(&marker) {
            return None;
        }
        let lengths = index[1..n_index - 1].chunks(n_length);
        let lengths =
            lengths.map(|bytes| bytes.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte)));
        let mut found = Vec::with_capacity(n_frames);
        for length in lengths {
            let (frame, rest) = frames.split_at(length.min(frames.len()));
            found.push(frame);
            frames = rest;
        }
        Some(found)
    };
    index().unwrap_or_else(|| vec![bytes])
}

/// The size that a frame of VP9 names, where it is no other frame's.
fn vp9_frame(bytes: &[u8]) -> Option<Option<Size>> {
    const SYNC: u32 = 0x49_83_42;
    let mut bits = Bits::new(bytes);
    if bits.read(2)? != 2 {
        return None;
    }
    let profile = bits.read(1)? | bits.read(1)? << 1;
    if profile == 3 {
        bits.skip(1)?;
    }
    let shows_existing = bits.read(1)? == 1;
    if shows_existing {
        return Some(None);
    }
    let (is_delta, is_shown, is_resilient) = (bits.read(1)? == 1, bits.read(1)? == 1, bits.read(1)? == 1);
    if !is_delta {
        if bits.read(24)? != SYNC {
            return None;
        }
        skip_color(&mut bits, profile)?;
        return vp9_size(&mut bits).map(Some);
    }
    let is_intra = !is_shown && bits.read(1)? == 1;
    if !is_resilient {
        bits.skip(2)?;
    }
    if is_intra {
        if bits.read(24)? != SYNC {
            return None;
        }
        if profile > 0 {
            skip_color(&mut bits, profile)?;
        }
        bits.skip(8)?;
        return vp9_size(&mut bits).map(Some);
    }
    bits.skip(8 + 3 * 4)?;
    for _ in 0..3 {
        let is_another_frames = bits.read(1)? == 1;
        if is_another_frames {
            return Some(None);
        }
    }
    vp9_size(&mut bits).map(Some)
}

fn skip_color(bits: &mut Bits<'_>, profile: u32) -> Option<()> {
    const RGB: u32 = 7;
    if profile >= 2 {
        bits.skip(1)?;
    }
    let has_sampling = profile % 2 == 1;
    if bits.read(3)? == RGB {
        bits.skip(usize::from(has_sampling))
    } else {
        bits.skip(1 + 3 * usize::from(has_sampling))
    }
}

fn vp9_size(bits: &mut Bits<'_>) -> Option<Size> {
    Some((bits.read(16)? + 1, bits.read(16)? + 1))
}

/// The largest size of the sequence headers among the units of AV1 in `bytes`.
pub(super) fn av1(mut bytes: &[u8]) -> Announced {
    const SEQUENCE_HEADER: u8 = 1;
    let mut announced = Announced::Nothing;
    while let [header, rest @ ..] = bytes {
        let (kind, has_extension, has_size) = (header >> 3 & 15, header & 4 != 0, header & 2 != 0);
        let Some(rest) = rest.get(usize::from(has_extension)..) else { return Announced::Unreadable };
        let (unit, behind) = if has_size {
            let Some((length, rest)) = leb128(rest) else { return Announced::Unreadable };
            rest.split_at(length.min(rest.len()))
        } else {
            (rest, &[][..])
        };
        if kind == SEQUENCE_HEADER {
            announced = announced.max(Announced::of(av1_sequence(unit)));
        }
        bytes = behind;
    }
    announced
}

fn leb128(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let mut value = 0;
    for (idx, byte) in bytes.iter().take(8).enumerate() {
        value |= usize::from(byte & 127) << (7 * idx);
        if byte & 128 == 0 {
            return Some((value, &bytes[idx + 1..]));
        }
    }
    None
}

fn av1_sequence(bytes: &[u8]) -> Option<Size> {
    let mut bits = Bits::new(bytes);
    bits.skip(4)?;
    if bits.read(1)? == 1 {
        // A still picture has a reduced header.
        bits.skip(5)?;
    } else {
        let (mut has_decoder_model, mut n_delay) = (false, 0);
        if bits.read(1)? == 1 {
            bits.skip(64)?;
            if bits.read(1)? == 1 {
                bits.exponential()?;
            }
            has_decoder_model = bits.read(1)? == 1;
            if has_decoder_model {
                n_delay = bits.read(5)? as usize + 1;
                bits.skip(32 + 10)?;
            }
        }
        let has_display_delay = bits.read(1)? == 1;
        for _ in 0..=bits.read(5)? {
            bits.skip(12)?;
            if bits.read(5)? > 7 {
                bits.skip(1)?;
            }
            if has_decoder_model && bits.read(1)? == 1 {
                bits.skip(2 * n_delay + 1)?;
            }
            if has_display_delay && bits.read(1)? == 1 {
                bits.skip(4)?;
            }
        }
    }
    let (n_width, n_height) = (bits.read(4)? + 1, bits.read(4)? + 1);
    Some((bits.read(n_width)? + 1, bits.read(n_height)? + 1))
}

/// The largest size of the video object layers of MPEG-4 part 2 in `bytes`.
pub(super) fn mpeg4(bytes: &[u8]) -> Announced {
    let layers = between_start_codes(bytes).into_iter().filter_map(|unit| match unit {
        [0x20..=0x2f, layer @ ..] => Some(mpeg4_layer(layer)),
        _ => None,
    });
    layers.fold(Announced::Nothing, |most, size| match size {
        // A layer of another shape than a rectangle has no size of its own.
        Some(None) => most,
        Some(Some(size)) => most.max(Announced::Size(size)),
        None => most.max(Announced::Unreadable),
    })
}

fn mpeg4_layer(bytes: &[u8]) -> Option<Option<Size>> {
    const RECTANGLE: u32 = 0;
    let mut bits = Bits::new(bytes);
    bits.skip(1)?;
    // Those of studios have another header, and nobody's camera is one.
    if matches!(bits.read(8)?, 14 | 15) {
        return None;
    }
    let mut version = 1;
    if bits.read(1)? == 1 {
        version = bits.read(4)?;
        bits.skip(3)?;
    }
    if bits.read(4)? == 15 {
        bits.skip(16)?;
    }
    if bits.read(1)? == 1 {
        bits.skip(3)?;
        if bits.read(1)? == 1 {
            bits.skip(79)?;
        }
    }
    let shape = bits.read(2)?;
    if shape == 3 && version != 1 {
        bits.skip(4)?;
    }
    bits.skip(1)?;
    let resolution = bits.read(16)?;
    bits.skip(1)?;
    if bits.read(1)? == 1 {
        // It has as many bits as the largest increment takes.
        bits.skip((u32::BITS - resolution.saturating_sub(1).leading_zeros()).max(1) as usize)?;
    }
    if shape != RECTANGLE {
        return Some(None);
    }
    bits.skip(1)?;
    let width = bits.read(13)?;
    bits.skip(1)?;
    Some(Some((width, bits.read(13)?)))
}

/// The size in a PNG file's first bytes; what does not begin so goes on with a file.
pub(super) fn png(bytes: &[u8]) -> Announced {
    let Some(rest) = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n") else { return Announced::Nothing };
    let sides = rest.get(8..16).map(|sides| sides.split_at(4));
    let side = |bytes: &[u8]| bytes.iter().fold(0_u32, |side, byte| side << 8 | u32::from(*byte));
    Announced::of(sides.map(|(width, height)| (side(width), side(height))))
}

/// The size in a BMP file's first bytes; what does not begin so goes on with a file.
pub(super) fn bmp(bytes: &[u8]) -> Announced {
    let Some(rest) = bytes.strip_prefix(b"BM") else { return Announced::Nothing };
    let number = |at: usize| {
        let bytes: Option<[u8; 4]> = rest.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
        bytes.map(i32::from_le_bytes)
    };
    let size = match number(12) {
        // The oldest form has sides of two bytes.
        Some(12) => number(16).map(|sides| (sides as u32 & 0xffff, sides as u32 >> 16)),
        _ => number(16).zip(number(20)).map(|(width, height)| (width.unsigned_abs(), height.unsigned_abs())),
    };
    Announced::of(size)
}

/// The size in a YUV4MPEG file's first line; what does not begin so goes on with a file.
pub(super) fn y4m(bytes: &[u8]) -> Announced {
    const MOST_LINE_BYTES: usize = 1024;
    let Some(rest) = bytes.strip_prefix(b"YUV4MPEG2") else { return Announced::Nothing };
    let line = rest.iter().take(MOST_LINE_BYTES).position(|byte| *byte == b'\n').map(|end| &rest[..end]);
    let side = |letter: u8| {
        let word = line?.split(u8::is_ascii_whitespace).find(|word| word.first() == Some(&letter))?;
        let digits = std::str::from_utf8(&word[1..]).ok()?;
        // A number that is larger than any has room for is too large all the same.
        let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| digits.parse().unwrap_or(u32::MAX))
    };
    Announced::of(side(b'W').zip(side(b'H')))
}

/// Bits of a header, the highest of each byte first.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next `n_bits`, at most 32.
    fn read(&mut self, n_bits: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..n_bits {
            let byte = *self.bytes.get(self.at / 8)?;
            value = value << 1 | u32::from(byte >> (7 - self.at % 8) & 1);
            self.at += 1;
        }
        Some(value)
    }

    fn skip(&mut self, n_bits: usize) -> Option<()> {
        self.at = self.at.checked_add(n_bits)?;
        (self.at <= 8 * self.bytes.len()).then_some(())
    }

    /// A number in the code of Golomb: as many bits as there are zeros before it, and one.
    fn exponential(&mut self) -> Option<u32> {
        let mut n_zeros = 0;
        while self.read(1)? == 0 {
            n_zeros += 1;
            if n_zeros > 31 {
                return None;
            }
        }
        Some(((1_u64 << n_zeros) as u32 - 1) + self.read(n_zeros)?)
    }
}
