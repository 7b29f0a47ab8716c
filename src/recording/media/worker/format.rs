//! Formats of encoded frames, as they are told between processes: the fields that decoders and containers need, by name.

use gstreamer as gst;
use serde::{Deserialize, Serialize};

/// The codecs of which formats are told.
const CODECS: [&str; 12] = [
    "image/bmp",
    "image/jpeg",
    "image/png",
    "video/mpeg",
    "video/x-av1",
    "video/x-divx",
    "video/x-h264",
    "video/x-h265",
    "video/x-msmpeg",
    "video/x-vp8",
    "video/x-vp9",
    "video/x-xvid",
];

/// The fields that are told, with a value of each one's kind.
const FIELDS: [(&str, Kind); 26] = [
    ("alignment", Kind::Text),
    ("bit-depth-chroma", Kind::Unsigned),
    ("bit-depth-luma", Kind::Unsigned),
    ("chroma-format", Kind::Text),
    ("chroma-site", Kind::Text),
    ("codec_data", Kind::Bytes),
    ("coded-picture-structure", Kind::Text),
    ("colorimetry", Kind::Text),
    ("divxversion", Kind::Integer),
    ("format", Kind::Text),
    ("framerate", Kind::Fraction),
    ("height", Kind::Integer),
    ("interlace-mode", Kind::Text),
    ("level", Kind::Text),
    ("lossless", Kind::Truth),
    ("mpegversion", Kind::Integer),
    ("msmpegversion", Kind::Integer),
    ("parsed", Kind::Truth),
    ("pixel-aspect-ratio", Kind::Fraction),
    ("profile", Kind::Text),
    ("sof-marker", Kind::Integer),
    ("stream-format", Kind::Text),
    ("systemstream", Kind::Truth),
    ("tier", Kind::Text),
    ("variant", Kind::Text),
    ("width", Kind::Integer),
];

/// Kinds of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Integer,
    Unsigned,
    Fraction,
    Text,
    Truth,
    Bytes,
}

/// Most bytes of a value.
const MAX_VALUE_BYTES: usize = 64 << 10;

/// A codec with its size, its header and the like.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Format {
    codec: String,
    fields: Vec<(String, Value)>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Value {
    Integer(i32),
    Unsigned(u32),
    Fraction(i32, i32),
    Text(String),
    Truth(bool),
    Bytes(Vec<u8>),
}

impl Format {
    /// Returns the format that `caps` describe; none of a codec that is not known here.
    pub(super) fn of(caps: &gst::CapsRef) -> Option<Self> {
        let structure = caps.structure(0)?;
        let codec = structure.name().as_str();
        let fields = FIELDS.iter().filter_map(|(name, kind)| {
            let value = Value::of(structure.value(*name).ok()?, *kind)?;
            Some(((*name).to_owned(), value))
        });
        CODECS.contains(&codec).then(|| Self { codec: codec.to_owned(), fields: fields.collect() })
    }

    /// Returns the codec's media type.
    pub(super) fn codec(&self) -> &str {
        &self.codec
    }

    /// Returns the caps that it describes; none where it has something that [`Self::of`] never gives.
    pub(super) fn caps(&self) -> Option<gst::Caps> {
        let is_known = CODECS.contains(&self.codec.as_str())
            && self.fields.len() <= FIELDS.len()
            && self
                .fields
                .iter()
                .all(|(name, value)| FIELDS.contains(&(name.as_str(), value.kind())) && value.is_fit());
        if !is_known {
            return None;
        }
        let mut structure = gst::Structure::new_empty(self.codec.as_str());
        for (name, value) in &self.fields {
            value.put(&mut structure, name);
        }
        let caps = gst::Caps::builder_full().structure(structure).build();
        // Fields come once, in their order, and fractions are in lowest terms.
        (Self::of(&caps).as_ref() == Some(self)).then_some(caps)
    }
}

impl Value {
    fn of(value: &gst::glib::SendValue, kind: Kind) -> Option<Self> {
        Some(match kind {
            Kind::Integer => Self::Integer(value.get().ok()?),
            Kind::Unsigned => Self::Unsigned(value.get().ok()?),
            Kind::Fraction => {
                let fraction: gst::Fraction = value.get().ok()?;
                Self::Fraction(fraction.numer(), fraction.denom())
            }
            Kind::Text => Self::Text(value.get().ok()?),
            Kind::Truth => Self::Truth(value.get().ok()?),
            Kind::Bytes => {
                let buffer: gst::Buffer = value.get().ok()?;
                Self::Bytes(buffer.map_readable().ok()?.to_vec())
            }
        })
    }

    const fn kind(&self) -> Kind {
        match self {
            Self::Integer(_) => Kind::Integer,
            Self::Unsigned(_) => Kind::Unsigned,
            Self::Fraction(..) => Kind::Fraction,
            Self::Text(_) => Kind::Text,
            Self::Truth(_) => Kind::Truth,
            Self::Bytes(_) => Kind::Bytes,
        }
    }

    fn is_fit(&self) -> bool {
        match self {
            Self::Integer(_) | Self::Unsigned(_) | Self::Truth(_) => true,
            // The library takes no fraction that it cannot negate.
            Self::Fraction(numerator, denominator) => *numerator > i32::MIN && *denominator > 0,
            Self::Text(text) => text.len() < 100 && text.bytes().all(|byte| (32..127).contains(&byte)),
            Self::Bytes(bytes) => bytes.len() <= MAX_VALUE_BYTES,
        }
    }

    fn put(&self, structure: &mut gst::Structure, name: &str) {
        match self {
            Self::Integer(number) => structure.set(name, *number),
            Self::Unsigned(number) => structure.set(name, *number),
            Self::Fraction(numerator, denominator) => {
                structure.set(name, gst::Fraction::new(*numerator, *denominator));
            }
            Self::Text(text) => structure.set(name, text.as_str()),
            Self::Truth(truth) => structure.set(name, *truth),
            Self::Bytes(bytes) => structure.set(name, gst::Buffer::from_mut_slice(bytes.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(fields: &[(&str, Value)]) -> Format {
        gst::init().unwrap();
        let fields = fields.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
        Format { codec: "video/x-h264".to_owned(), fields }
    }

    #[test]
    fn formats_that_are_never_told_are_refused() {
        let (width, height) = (("width", Value::Integer(64)), ("height", Value::Integer(48)));
        let rate = |numerator, denominator| ("framerate", Value::Fraction(numerator, denominator));
        for told in [&[height.clone(), width.clone()][..], &[rate(25, 1)], &[rate(-1, 2)], &[]] {
            let told = format(told);
            assert_eq!(told.caps().and_then(|caps| Format::of(&caps)), Some(told));
        }
        for never in [
            &[width.clone(), height.clone()][..],
            &[width.clone(), width],
            &[height, ("height", Value::Integer(47))],
            &[rate(50, 2)],
            &[rate(1, 0)],
            &[rate(i32::MIN, 1)],
            &[("width", Value::Unsigned(64))],
            &[("secret", Value::Integer(64))],
            &[("profile", Value::Text("\u{1b}".to_owned()))],
        ] {
            let never = format(never);
            assert_eq!(never.caps(), None, "{never:?}");
        }
    }
}
