//! The size of the pictures that encoded bytes announce, read before a decoder sees them.
//!
//! A decoder allocates what a header claims, and a header of some ten bytes may claim gigabytes. Containers and parsers say
//! a size too, but not the decoder's: an AVI file of 320 x 240 may hold a stream of 8000 x 8000. So the stream's own headers
//! are read here, and no further than to the size.

mod headers;
#[cfg(test)]
mod tests;

use gstreamer as gst;
use headers::{av1, bmp, h264, h265, mpeg4, png, vp8, vp9, y4m};

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
        match (self, other) {
            (Self::Size(one), Self::Size(two)) => {
                // One that is too large counts before all that are not: a side may be too long by itself.
                let rank = |(width, height): Size| {
                    (
                        is_too_large((width, height)),
                        u64::from(width) * u64::from(height),
                        width.max(height),
                        width,
                    )
                };
                Self::Size(if rank(two) > rank(one) { two } else { one })
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
        // Decoders take what is no header of a container for a piece of the stream.
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
        "application/x-yuv4mpeg" => y4m(bytes),
        _ => Announced::Nothing,
    }
}

/// Returns what a buffer in front of a parser announces. A bare stream of AV1 has nothing by which its units are found again: only its
/// beginning, which is a temporal delimiter, can be read before it was parsed.
pub(super) fn before_parser(format: &gst::StructureRef, bytes: &[u8]) -> Announced {
    const DELIMITER: [u8; 2] = [0x12, 0];
    let is_cut_anywhere = format.name() == "video/x-av1" && !format.has_field("alignment");
    if is_cut_anywhere && !bytes.starts_with(&DELIMITER) {
        return Announced::Nothing;
    }
    in_bytes(format, bytes)
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
            // Sets of further layers, which are not decoded, are others.
            Codec::H265 if first == 33 << 1 && unit.get(1).is_some_and(|second| second >> 3 == 0) => {
                Some(h265(&without_escapes(unit.get(2..).unwrap_or_default())))
            }
            _ => None,
        }
    });
    sizes.fold(Announced::Nothing, |most, size| most.max(Announced::of(size)))
}

/// Returns the size that the parameter sets in a buffer announce. Units stand behind their lengths where the stream's format says so, else between
/// start codes; decoders look for start codes in both, and take a codec's header for what it is in either.
fn in_units(format: &gst::StructureRef, bytes: &[u8], codec: Codec) -> Announced {
    let with_start_codes = parameter_sets(&between_start_codes(bytes), codec);
    if !matches!(format.get::<&str>("stream-format"), Ok("avc" | "avc3" | "hvc1" | "hev1")) {
        return with_start_codes;
    }
    let units: Vec<&[u8]> = with_lengths(bytes, length_bytes(format)).collect();
    let with_lengths = parameter_sets(&units, codec);
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

/// Returns units that stand behind their lengths of `n_length` bytes each.
fn with_lengths(mut bytes: &[u8], n_length: usize) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let (length, rest) = bytes.split_at_checked(n_length).filter(|(_, rest)| !rest.is_empty())?;
        let length = length.iter().fold(0_usize, |length, byte| length << 8 | usize::from(*byte));
        let (unit, rest) = rest.split_at(length.min(rest.len()));
        bytes = rest;
        Some(unit)
    })
}

/// Content of a frame as it is encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Content {
    /// Neither a part of a picture nor a header of the codec.
    Nothing,
    /// Headers of the codec alone.
    Headers,
    /// At least a part of a picture.
    Picture,
}

/// Returns the content of a frame of that format whose units stand behind their lengths (H.264 and H.265, ITU-T H.264, table 7-1,
/// and H.265, table 7-1). Frames of other formats are taken for pictures.
pub(super) fn nal_content(format: &gst::StructureRef, bytes: &[u8]) -> Content {
    let of_unit: fn(u8) -> Content = match (format.name().as_str(), format.get::<&str>("stream-format")) {
        ("video/x-h264", Ok("avc" | "avc3")) => |first| match first & 31 {
            1..=5 | 20 => Content::Picture,
            7 | 8 | 13 | 15 => Content::Headers,
            _ => Content::Nothing,
        },
        ("video/x-h265", Ok("hvc1" | "hev1")) => |first| match first >> 1 & 63 {
            0..=31 => Content::Picture,
            32..=34 => Content::Headers,
            _ => Content::Nothing,
        },
        _ => return Content::Picture,
    };
    let mut most = Content::Nothing;
    for unit in with_lengths(bytes, length_bytes(format)) {
        most = most.max(unit.first().map_or(Content::Nothing, |first| of_unit(*first)));
        if most == Content::Picture {
            break;
        }
    }
    most
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
