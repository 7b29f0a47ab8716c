//! The size of the pictures that encoded bytes announce, read before a decoder sees them.
//!
//! A decoder allocates what a header claims, and a header of some ten bytes may claim gigabytes. Containers and parsers say
//! a size too, but not the decoder's: an AVI file of 320 x 240 may hold a stream of 8000 x 8000. So the stream's own headers
//! are read here, and no further than to the size.
//!
//! Formulas: ITU-T H.264 7.3.2.1, H.265 7.3.2.2, RFC 6386 9.1 (VP8), the VP9 bitstream specification 6.2, the AV1
//! specification 5.5, ISO/IEC 14496-2 6.2.3 (MPEG-4 part 2).

use gstreamer as gst;

/// Most columns and rows of a picture: beyond it lies what no camera makes.
pub const MAX_SIDE: u32 = 8192;

/// Most pixels of a picture, some more than 7680 x 4320.
pub(super) const MAX_PIXELS: u64 = 36 << 20;

/// Columns and rows.
pub(super) type Size = (u32, u32);

/// The size of pictures that encoded bytes announce.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Announced {
    /// No size is said, or that of before holds.
    Nothing,
    /// Pictures of this size; of several the largest.
    Size(Size),
    /// A header that cannot be read.
    Unreadable,
}

impl Announced {
    fn of(size: Option<Size>) -> Self {
        size.map_or(Self::Unreadable, Self::Size)
    }

    /// Returns the one of two that asks for more: a size, the largest of two, before a header that cannot be read.
    pub(super) fn max(self, other: Self) -> Self {
        let n_pixels = |size: Size| u64::from(size.0) * u64::from(size.1);
        match (self, other) {
            (Self::Size(one), Self::Size(two)) => {
                // A side may be too long by itself.
                let longest = |size: Size| size.0.max(size.1);
                if is_too_large(two) && !is_too_large(one) || longest(two) > longest(one) {
                    return Self::Size(two);
                }
                Self::Size(if n_pixels(two) > n_pixels(one) { two } else { one })
            }
            (Self::Unreadable, Self::Size(size)) | (Self::Size(size), Self::Unreadable)
                if is_too_large(size) =>
            {
                Self::Size(size)
            }
            (Self::Unreadable, _) | (_, Self::Unreadable) => Self::Unreadable,
            (Self::Nothing, said) | (said, Self::Nothing) => said,
        }
    }

    /// Returns what two readings of the same bytes come to, of which decoders may take either: any size counts, and a header
    /// that cannot be read counts by the first reading alone.
    fn or_else(self, other: Self) -> Self {
        match (self, other) {
            (Self::Unreadable, Self::Size(size)) => Self::Size(size),
            (said, Self::Size(_)) => said.max(other),
            (said, _) => said,
        }
    }
}

/// Returns whether pictures of so many columns and rows are beyond the limits ([`super::SIZE_LIMIT`]).
#[must_use]
pub fn is_too_large((width, height): (u32, u32)) -> bool {
    width > MAX_SIDE || height > MAX_SIDE || u64::from(width) * u64::from(height) > MAX_PIXELS
}

/// Returns the size that a stream's format names, where it names one.
pub(super) fn size_of_format(format: &gst::StructureRef) -> Option<Size> {
    let side = |name| format.get::<i32>(name).ok().and_then(|side| u32::try_from(side).ok());
    Some((side("width")?, side("height")?))
}

/// Returns what the codec's header in a stream's format announces.
pub(super) fn in_format(format: &gst::StructureRef) -> Announced {
    let Ok(buffer) = format.get::<gst::Buffer>("codec_data") else { return Announced::Nothing };
    let Ok(header) = buffer.map_readable() else { return Announced::Unreadable };
    let with_start_codes = |codec| parameter_sets(&between_start_codes(&header), codec);
    match format.name().as_str() {
        // Where it is no header of a container, decoders take it for a piece of the stream.
        "video/x-h264" if header.first() == Some(&1) => {
            parameter_sets(&avc_header(&header), Codec::H264).or_else(with_start_codes(Codec::H264))
        }
        "video/x-h264" => with_start_codes(Codec::H264),
        "video/x-h265" if !header.starts_with(&[0, 0, 1]) && !header.starts_with(&[0, 0, 0, 1]) => {
            parameter_sets(&hevc_header(&header), Codec::H265).or_else(with_start_codes(Codec::H265))
        }
        "video/x-h265" => with_start_codes(Codec::H265),
        "video/mpeg" | "video/x-divx" | "video/x-xvid" => mpeg4(&header),
        // The first four bytes are the container's.
        "video/x-av1" => header.get(4..).map_or(Announced::Nothing, av1),
        _ => Announced::Nothing,
    }
}

/// Returns what a buffer of a stream of that format announces.
pub(super) fn in_bytes(format: &gst::StructureRef, bytes: &[u8]) -> Announced {
    match format.name().as_str() {
        "video/x-h264" => in_units(format, bytes, Codec::H264),
        "video/x-h265" => in_units(format, bytes, Codec::H265),
        "image/jpeg" => super::jpeg::announced(bytes),
        "image/png" => png(bytes),
        "image/bmp" => bmp(bytes),
        "video/x-vp8" => vp8(bytes),
        "video/x-vp9" => vp9(bytes),
        "video/x-av1" => av1(bytes),
        "video/mpeg" | "video/x-divx" | "video/x-xvid" => mpeg4(bytes),
        _ => Announced::Nothing,
    }
}

#[derive(Clone, Copy)]
enum Codec {
    H264,
    H265,
}

/// The largest of the sizes in the parameter sets among `units`.
fn parameter_sets(units: &[&[u8]], codec: Codec) -> Announced {
    let sizes = units.iter().filter_map(|unit| {
        let first = *unit.first()?;
        match codec {
            // Also a subset parameter set, which begins alike.
            Codec::H264 if matches!(first & 31, 7 | 15) => {
                Some(h264(&without_escapes(unit.get(1..).unwrap_or_default())))
            }
            // Of further layers, which are not decoded, the sets are others.
            Codec::H265 if first == 33 << 1 && unit.get(1).is_some_and(|second| second >> 3 == 0) => {
                Some(h265(&without_escapes(unit.get(2..).unwrap_or_default())))
            }
            _ => None,
        }
    });
    sizes.fold(Announced::Nothing, |most, size| most.max(Announced::of(size)))
}

/// What the parameter sets in a buffer announce. Units stand behind their lengths where the stream's format says so, else between
/// start codes; decoders look for start codes in both, and take a codec's header for what it is in either.
fn in_units(format: &gst::StructureRef, bytes: &[u8], codec: Codec) -> Announced {
    let with_start_codes = parameter_sets(&between_start_codes(bytes), codec);
    if !matches!(format.get::<&str>("stream-format"), Ok("avc" | "avc3" | "hvc1" | "hev1")) {
        return with_start_codes;
    }
    let with_lengths = parameter_sets(&with_lengths(bytes, length_bytes(format)), codec);
    let is_header = matches!(bytes, [1, _, _, _, lengths, sets, ..] if lengths >> 2 == 63 && sets >> 5 == 7);
    let as_header = if is_header { parameter_sets(&avc_header(bytes), codec) } else { Announced::Nothing };
    with_lengths.or_else(with_start_codes).or_else(as_header)
}

/// Returns the bytes that each unit's length takes, by the codec's header.
fn length_bytes(format: &gst::StructureRef) -> usize {
    let is_h264 = format.name() == "video/x-h264";
    let header = format.get::<gst::Buffer>("codec_data").ok();
    let header = header.as_ref().and_then(|buffer| buffer.map_readable().ok());
    let byte = header.and_then(|header| header.get(if is_h264 { 4 } else { 21 }).copied());
    byte.map_or(4, |byte| usize::from(byte & 3) + 1)
}

fn with_lengths(mut bytes: &[u8], n_length: usize) -> Vec<&[u8]> {
    let mut units = Vec::new();
    while bytes.len() > n_length {
        let (length, rest) = bytes.split_at(n_length);
        let length = length.iter().fold(0_usize, |length, byte| length << 8 | usize::from(*byte));
        let (unit, rest) = rest.split_at(length.min(rest.len()));
        units.push(unit);
        bytes = rest;
    }
    units
}

fn between_start_codes(bytes: &[u8]) -> Vec<&[u8]> {
    let mut units = Vec::new();
    let mut begins = None;
    let mut at = 0;
    while let Some([first, second, third]) = bytes.get(at..at + 3) {
        at += match (first, second, third) {
            (0, 0, 1) => {
                units.extend(begins.map(|begins| &bytes[begins..at]));
                begins = Some(at + 3);
                3
            }
            (_, _, 0) => 1,
            // No start code has such a byte in its first or second place.
            _ => 3,
        };
    }
    units.extend(begins.map(|begins| &bytes[begins..]));
    units
}

/// The parameter sets in an `AVCDecoderConfigurationRecord`.
fn avc_header(header: &[u8]) -> Vec<&[u8]> {
    let n_sets = header.get(5).map_or(0, |byte| byte & 31);
    counted_units(header.get(6..).unwrap_or_default(), usize::from(n_sets)).0
}

/// The parameter sets in an `HEVCDecoderConfigurationRecord`.
fn hevc_header(header: &[u8]) -> Vec<&[u8]> {
    let n_arrays = header.get(22).copied().unwrap_or(0);
    let mut rest = header.get(23..).unwrap_or_default();
    let mut units = Vec::new();
    for _ in 0..n_arrays {
        let [_kind, high, low, behind @ ..] = rest else { break };
        let (found, behind) = counted_units(behind, usize::from(u16::from_be_bytes([*high, *low])));
        units.extend(found);
        rest = behind;
    }
    units
}

/// Returns as many units as that, each behind two bytes of its length, and what follows them.
fn counted_units(mut bytes: &[u8], n_units: usize) -> (Vec<&[u8]>, &[u8]) {
    let mut units = Vec::new();
    for _ in 0..n_units {
        let [high, low, rest @ ..] = bytes else { break };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        let (unit, rest) = rest.split_at(length.min(rest.len()));
        units.push(unit);
        bytes = rest;
    }
    (units, bytes)
}

/// A unit's bytes without those that keep start codes from appearing in it (`0 0 3`).
fn without_escapes(unit: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(unit.len().min(256));
    let mut n_zeros = 0;
    for byte in unit {
        if n_zeros >= 2 && *byte == 3 {
            n_zeros = 0;
            continue;
        }
        n_zeros = if *byte == 0 { n_zeros + 1 } else { 0 };
        bytes.push(*byte);
    }
    bytes
}

/// The size in a sequence parameter set of H.264, cut to nothing.
fn h264(bytes: &[u8]) -> Option<Size> {
    let mut bits = Bits::new(bytes);
    let profile = bits.read(8)?;
    bits.skip(16)?;
    bits.exponential()?;
    // Which profiles tell their chroma: all but the oldest three.
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
fn h265(bytes: &[u8]) -> Option<Size> {
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
fn vp8(bytes: &[u8]) -> Announced {
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
fn vp9(bytes: &[u8]) -> Announced {
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
fn av1(mut bytes: &[u8]) -> Announced {
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
fn mpeg4(bytes: &[u8]) -> Announced {
    let layers = between_start_codes(bytes).into_iter().filter_map(|unit| match unit {
        [0x20..=0x2f, layer @ ..] => Some(mpeg4_layer(layer)),
        _ => None,
    });
    layers.fold(Announced::Nothing, |most, size| match size {
        // A layer of another shape than a rectangle has no size of its own.
        Some(None) => most,
        Some(Some(size)) => most.max(Announced::Size(size)),
        None => Announced::Unreadable,
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
        // As many bits as the largest increment takes.
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
fn png(bytes: &[u8]) -> Announced {
    let Some(rest) = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n") else { return Announced::Nothing };
    let sides = rest.get(8..16).map(|sides| sides.split_at(4));
    let side = |bytes: &[u8]| bytes.iter().fold(0_u32, |side, byte| side << 8 | u32::from(*byte));
    Announced::of(sides.map(|(width, height)| (side(width), side(height))))
}

/// The size in a BMP file's first bytes; what does not begin so goes on with a file.
fn bmp(bytes: &[u8]) -> Announced {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::{Decoder, Fault, Input, fault::SIZE_LIMIT};
    use gst::prelude::*;

    /// Writes bits, the highest of each byte first.
    #[derive(Default)]
    struct Written(Vec<bool>);

    impl Written {
        fn bits(mut self, value: u32, n_bits: u32) -> Self {
            self.0.extend((0..n_bits).rev().map(|bit| value >> bit & 1 == 1));
            self
        }

        fn exponential(self, value: u32) -> Self {
            let n_bits = (value + 1).ilog2();
            self.bits(0, n_bits).bits(value + 1, n_bits + 1)
        }

        fn bytes(&self) -> Vec<u8> {
            let byte = |bits: &[bool]| {
                bits.iter().zip(0..).fold(0, |byte, (bit, at)| byte | u8::from(*bit) << (7 - at))
            };
            self.0.chunks(8).map(byte).collect()
        }

        /// The bytes behind `head`, with what keeps start codes from appearing in them.
        fn unit(&self, head: &[u8]) -> Vec<u8> {
            let mut unit = head.to_vec();
            for byte in self.bytes() {
                if byte <= 3 && unit.ends_with(&[0, 0]) {
                    unit.push(3);
                }
                unit.push(byte);
            }
            unit
        }
    }

    /// A sequence parameter set of H.264 for so many macroblocks, in the form that is written with the most before the size.
    fn h264_set(width: u32, height: u32) -> Vec<u8> {
        let set =
            Written::default().bits(244, 8).bits(0, 8).bits(40, 8).exponential(0).exponential(3).bits(0, 1);
        let mut set = set.exponential(0).exponential(0).bits(0, 1).bits(1, 1);
        for list in 0..12 {
            // The second and the eighth list say all of their numbers, the third that it goes on as it stands; the others are left out.
            set = match list {
                1 => (0..16).fold(set.bits(1, 1), |set, _| set.exponential(1)),
                2 => set.bits(1, 1).exponential(16),
                7 => (0..64).fold(set.bits(1, 1), |set, _| set.exponential(1)),
                _ => set.bits(0, 1),
            };
        }
        let set = set
            .exponential(4)
            .exponential(1)
            .bits(0, 1)
            .exponential(2)
            .exponential(2)
            .exponential(1)
            .exponential(9);
        set.exponential(1)
            .bits(0, 1)
            .exponential(width / 16 - 1)
            .exponential(height / 32 - 1)
            .bits(0, 2)
            .bits(1, 1)
            .bits(0, 2)
            .bits(1, 1)
            .unit(&[0x67])
    }

    fn h265_set(width: u32, height: u32) -> Vec<u8> {
        let set = Written::default().bits(0, 4).bits(2, 3).bits(1, 1).bits(0, 32).bits(0, 32).bits(0, 32);
        // Two layers: the first with a profile, the second with a level.
        let set = set.bits(0b10_01, 4).bits(0, 12).bits(0, 32).bits(0, 32).bits(0, 24).bits(0, 8);
        set.exponential(0)
            .exponential(3)
            .bits(0, 1)
            .exponential(width)
            .exponential(height)
            .bits(1, 1)
            .unit(&[0x42, 1])
    }

    fn announced(format: &str, bytes: &[u8]) -> Announced {
        gst::init().unwrap();
        let caps: gst::Caps = format.parse().unwrap();
        in_bytes(caps.structure(0).unwrap(), bytes)
    }

    fn coded(unit: &[u8]) -> Vec<u8> {
        [&[0, 0, 0, 1][..], unit].concat()
    }

    #[test]
    fn the_size_is_read_from_what_encoders_write() {
        gst::init().unwrap();
        let cases = [
            ("x264enc ! video/x-h264,stream-format=byte-stream", "video/x-h264", (160, 128)),
            ("x264enc ! video/x-h264,stream-format=avc", "video/x-h264", (160, 128)),
            ("x264enc ! video/x-h264,profile=high", "video/x-h264", (160, 128)),
            ("x265enc ! video/x-h265,stream-format=byte-stream", "video/x-h265", (160, 120)),
            ("x265enc ! h265parse ! video/x-h265,stream-format=hvc1", "video/x-h265", (160, 120)),
            ("jpegenc", "image/jpeg", (160, 120)),
            ("pngenc", "image/png", (160, 120)),
            ("avenc_bmp", "image/bmp", (160, 120)),
            ("vp8enc deadline=1", "video/x-vp8", (160, 120)),
            ("vp9enc deadline=1 cpu-used=8", "video/x-vp9", (160, 120)),
            ("av1enc cpu-used=8", "video/x-av1", (160, 120)),
            ("avenc_mpeg4", "video/mpeg", (160, 120)),
        ];
        for (encoder, kind, expected) in cases {
            let description = format!(
                "videotestsrc num-buffers=12 ! video/x-raw,width=160,height=120,framerate=10/1 ! videoconvert ! {encoder} ! \
                 appsink name=out sync=false"
            );
            let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
            let sink = pipeline.by_name("out").unwrap().downcast::<gstreamer_app::AppSink>().unwrap();
            pipeline.set_state(gst::State::Playing).unwrap();
            let mut said = Announced::Nothing;
            let mut n_buffers = 0;
            while let Ok(sample) = sink.pull_sample() {
                let format = sample.caps().unwrap().structure(0).unwrap();
                assert_eq!(format.name(), kind);
                let bytes = sample.buffer().unwrap().map_readable().unwrap();
                said = said.max(in_format(format)).max(in_bytes(format, &bytes));
                n_buffers += 1;
            }
            pipeline.set_state(gst::State::Null).unwrap();
            assert!(n_buffers >= 12, "{encoder}: {n_buffers}");
            assert_eq!(said, Announced::Size(expected), "{encoder}");
        }
    }

    #[test]
    fn every_header_tells_its_size_wherever_it_stands() {
        let size = Announced::Size;
        let byte_stream = "video/x-h264,stream-format=byte-stream";
        let sets = [coded(&h264_set(320, 64)), coded(&[0x41, 9, 9]), coded(&h264_set(16_384, 4096))];
        assert_eq!(announced(byte_stream, &sets[0]), size((320, 64)));
        assert_eq!(
            announced(byte_stream, &sets.concat()),
            size((16_384, 4096)),
            "the second set of a buffer"
        );
        assert_eq!(announced(byte_stream, &sets[1]), Announced::Nothing);
        assert_eq!(announced(byte_stream, &coded(&[0x67, 100, 0])), Announced::Unreadable);
        let with_length =
            [&[0, 0, 0, 2, 0x41, 9][..], &(sets[2].len() as u32 - 4).to_be_bytes(), &sets[2][4..]];
        assert_eq!(announced("video/x-h264,stream-format=avc", &with_length.concat()), size((16_384, 4096)));
        let set = coded(&h265_set(9000, 40));
        assert_eq!(announced("video/x-h265,stream-format=byte-stream", &set), size((9000, 40)));
        // Units that a decoder finds by start codes though the stream has lengths, or takes for a header.
        let avc = "video/x-h264,stream-format=avc";
        let large = h264_set(16_384, 4096);
        let hidden = [&[0, 0, 0, large.len() as u8 + 6][..], &[0x41, 9, 0, 0, 1], &large, &[0]].concat();
        assert_eq!(announced(avc, &hidden), size((16_384, 4096)));
        assert_eq!(
            announced(avc, &coded(&h264_set(320, 64))),
            size((320, 64)),
            "start codes in place of lengths"
        );
        let header = [&[1, 100, 0, 40, 0xff, 0xe1][..], &(large.len() as u16).to_be_bytes(), &large].concat();
        assert_eq!(announced(avc, &header), size((16_384, 4096)));
        let layer = [&[0x42, 9][..], &h265_set(9000, 40)[2..]].concat();
        assert_eq!(
            announced("video/x-h265,stream-format=byte-stream", &coded(&layer)),
            Announced::Nothing,
            "a set of a layer that is not decoded"
        );
        // The codec's headers, with one set each.
        let with_header = |kind: &str, header: &[u8]| {
            gst::init().unwrap();
            let buffer = gst::Buffer::from_slice(header.to_vec());
            let caps = gst::Caps::builder(kind).field("codec_data", buffer).build();
            in_format(caps.structure(0).unwrap())
        };
        let set = h264_set(16_384, 4096);
        let header =
            [&[1, 100, 0, 40, 0xff, 0xe1][..], &(set.len() as u16).to_be_bytes(), &set, &[0]].concat();
        assert_eq!(with_header("video/x-h264", &header), size((16_384, 4096)));
        let set = h265_set(9000, 40);
        let header =
            [&[0; 22][..], &[2, 32, 0, 0, 33, 0, 1], &(set.len() as u16).to_be_bytes(), &set].concat();
        assert_eq!(with_header("video/x-h265", &header), size((9000, 40)));

        let vp8 = [0x10, 0, 0, 0x9d, 1, 0x2a, 0xff, 0x7f, 0xff, 0x3f];
        assert_eq!(announced("video/x-vp8", &vp8), size((16_383, 16_383)), "without the bits of scaling");
        assert_eq!(announced("video/x-vp8", &vp8[..9]), Announced::Unreadable);
        // A frame of VP9 that builds on others may still have a size of its own, and be the second of two.
        let key =
            Written::default().bits(2, 2).bits(0, 3).bits(0, 1).bits(1, 1).bits(0, 1).bits(0x49_83_42, 24);
        let key = key.bits(1, 3).bits(0, 1).bits(319, 16).bits(239, 16).bytes();
        let delta =
            Written::default().bits(2, 2).bits(0, 3).bits(1, 1).bits(1, 1).bits(0, 1).bits(0, 2).bits(0, 20);
        let delta = delta.bits(0, 3).bits(65_535, 16).bits(99, 16).bytes();
        assert_eq!(announced("video/x-vp9", &key), size((320, 240)));
        assert_eq!(announced("video/x-vp9", &delta), size((65_536, 100)));
        let both = [&key[..], &delta, &[0xc1, key.len() as u8, delta.len() as u8, 0xc1]].concat();
        assert_eq!(announced("video/x-vp9", &both), size((65_536, 100)));
        let sequence = Written::default().bits(0, 3).bits(1, 1).bits(1, 1).bits(0, 5).bits(15, 4).bits(15, 4);
        let sequence = [&[0x0a, 7][..], &sequence.bits(65_535, 16).bits(7, 16).bytes()].concat();
        assert_eq!(announced("video/x-av1", &[&[0x12, 0][..], &sequence].concat()), size((65_536, 8)));
        let layer =
            Written::default().bits(0, 9).bits(1, 1).bits(1, 7).bits(1, 4).bits(0, 1).bits(0, 2).bits(1, 1);
        let layer = layer.bits(25, 16).bits(1, 1).bits(1, 1).bits(1, 5).bits(1, 1).bits(8191, 13).bits(1, 1);
        let layer = [&[0, 0, 1, 0x20][..], &layer.bits(8190, 13).bits(1, 1).bytes()].concat();
        assert_eq!(announced("video/mpeg", &layer), size((8191, 8190)));
        let studio = Written::default().bits(0, 1).bits(14, 8).bits(0, 30).bits(0, 30);
        assert_eq!(
            announced("video/mpeg", &[&[0, 0, 1, 0x20][..], &studio.bytes()].concat()),
            Announced::Unreadable
        );
        let oldest = [&b"BM"[..], &[0; 12], &[12, 0, 0, 0, 0x10, 0x27, 0x20, 0]].concat();
        assert_eq!(announced("image/bmp", &oldest), size((10_000, 32)));
    }

    #[test]
    fn no_bytes_are_read_past_their_end() {
        for kind in [
            "video/x-h264",
            "video/x-h265",
            "image/jpeg",
            "video/x-vp8",
            "video/x-vp9",
            "video/x-av1",
            "video/mpeg",
            "image/png",
            "image/bmp",
        ] {
            let mut random = 12_345_u64;
            for n_bytes in 0..300 {
                let bytes: Vec<u8> = (0..n_bytes)
                    .map(|_| {
                        random = random
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1_442_695_040_888_963_407);
                        // Zeros and ones are what start codes are made of.
                        [0, 0, 1, (random >> 40) as u8][(random >> 60) as usize % 4]
                    })
                    .collect();
                std::hint::black_box(announced(kind, &bytes));
            }
        }
    }

    #[test]
    fn limits_are_as_they_are_told() {
        assert_eq!(SIZE_LIMIT, format!("{MAX_SIDE} pixels a side and {} megapixels", MAX_PIXELS >> 20));
        assert!(!is_too_large((8192, 4608)) && !is_too_large((7680, 4320)));
        assert!(is_too_large((8193, 1)) && is_too_large((1, 8193)) && is_too_large((8192, 4609)));
    }

    /// Returns the fault that a file of these bytes comes to.
    fn fault_of(bytes: &[u8]) -> Fault {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, bytes).unwrap();
        let decoder = Decoder::start(&Input::file(&path).unwrap(), None).unwrap();
        for _ in 0..50 {
            if let Some(sample) = decoder.pull(gst::ClockTime::from_mseconds(100)) {
                panic!("a picture came: {:?}", sample.caps());
            }
            if let Some(fault) = decoder.fault() {
                return fault;
            }
            if decoder.has_ended() {
                return Fault::Damaged("it ended".to_owned());
            }
        }
        panic!("nothing came");
    }

    #[test]
    fn files_that_claim_too_much_are_refused_for_their_size() {
        let jpeg = |width: u16, height: u16| {
            let [h0, h1] = height.to_be_bytes();
            let [w0, w1] = width.to_be_bytes();
            let frame = [0xff, 0xc0, 0, 17, 8, h0, h1, w0, w1, 3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0];
            let scan = [0xff, 0xda, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 63, 0, 1, 2, 3, 0xff, 0xd9];
            let comment = [&[0xff, 0xfe, 0x40, 0][..], &[32; 0x3ffe]].concat();
            [&[0xff, 0xd8][..], &comment, &frame, &scan].concat()
        };
        let png = |side: u32| {
            let sides = [side.to_be_bytes(), side.to_be_bytes()].concat();
            let head = [&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"[..], &sides, &[8, 2, 0, 0, 0, 1, 2, 3, 4]].concat();
            [&head[..], &b"\0\0\0\x08IDAT12345678CRC4\0\0\0\0IEND\xaeB`\x82"[..]].concat()
        };
        let bmp = |side: i32| {
            let sides = [side.to_le_bytes(), side.to_le_bytes()].concat();
            let head = [&b"BM"[..], &[0xff, 0xff, 0, 0, 0, 0, 0, 0, 54, 0, 0, 0, 40, 0, 0, 0]].concat();
            [&head[..], &sides, &[1, 0, 24, 0], &[0; 2000]].concat()
        };
        let ivf = |code: &[u8; 4], frame: &[u8]| {
            let head =
                [&b"DKIF\0\0 \0"[..], code, &[64, 0, 48, 0, 25, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]]
                    .concat();
            [&head[..], &(frame.len() as u32).to_le_bytes(), &[0; 8], frame].concat()
        };
        let vp8 = [&[0x10, 0, 0, 0x9d, 1, 0x2a, 0xff, 0x3f, 0xff, 0x3f][..], &[0; 90]].concat();
        let key =
            Written::default().bits(2, 2).bits(0, 3).bits(0, 1).bits(1, 1).bits(0, 1).bits(0x49_83_42, 24);
        let vp9 = [key.bits(1, 3).bits(0, 1).bits(59_999, 16).bits(59_999, 16).bytes(), vec![1; 60]].concat();
        let picture_set = coded(&[0x68, 0xce, 0x38, 0x80]);
        let slice = coded(&[&[0x65, 0x88, 0x84][..], &[0x5a; 60]].concat());
        let h264 = [coded(&h264_set(16_384, 16_384)), picture_set, slice.clone(), slice].concat();
        for (what, bytes) in [
            ("JPEG", jpeg(60_000, 60_000)),
            ("JPEG of many pixels", jpeg(8000, 8000)),
            ("PNG", png(60_000)),
            ("BMP", bmp(60_000)),
            ("VP8", ivf(b"VP80", &vp8)),
            ("VP9", ivf(b"VP90", &vp9)),
            ("H.264", h264.repeat(3)),
        ] {
            let fault = fault_of(&bytes);
            assert!(matches!(fault, Fault::TooLarge { .. }), "{what}: {fault:?}");
            assert!(fault.to_string().contains("megapixels"), "{fault}");
        }
    }

    #[test]
    fn formats_that_are_not_named_are_refused_whatever_is_installed() {
        let svg = b"<?xml version=\"1.0\"?><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"32000\" height=\"32000\"/>";
        let webp =
            [&b"RIFF\x1e\0\0\0WEBPVP8 \x12\0\0\0\x10\0\0\x9d\x01\x2a\xff\x3f\xff\x3f"[..], &[0; 8]].concat();
        let jp2 = [&b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\x14ftypjp2 \0\0\0\0jp2 "[..], &[0; 120]].concat();
        for (name, bytes) in [("SVG", &svg[..]), ("WebP", &webp), ("JPEG 2000", &jp2)] {
            let fault = fault_of(bytes);
            assert!(matches!(&fault, Fault::Refused { format, .. } if format == name), "{name}: {fault:?}");
            assert!(fault.to_string().contains("H.264"), "{fault}");
        }
    }
}
