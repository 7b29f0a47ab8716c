//! Which of `GStreamer`'s parts are there, asked without making any.

use super::Fault;
use super::allowed::is_allowed;
use super::fault::gstreamer_fault;
use super::input::Keep;
use gstreamer as gst;

/// Encoded video, as cameras and files hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// H.264.
    H264,
    /// H.265.
    H265,
    /// Motion JPEG, and pictures.
    Jpeg,
    /// VP8.
    Vp8,
    /// VP9.
    Vp9,
}

impl Codec {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::H264, Self::H265, Self::Jpeg, Self::Vp8, Self::Vp9];

    /// As people know it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::H264 => "H.264",
            Self::H265 => "H.265",
            Self::Jpeg => "JPEG",
            Self::Vp8 => "VP8",
            Self::Vp9 => "VP9",
        }
    }

    const fn caps(self) -> &'static str {
        match self {
            Self::H264 => "video/x-h264",
            Self::H265 => "video/x-h265",
            Self::Jpeg => "image/jpeg",
            Self::Vp8 => "video/x-vp8",
            Self::Vp9 => "video/x-vp9",
        }
    }
}

/// Those of `names` of which there is no such element.
///
/// # Errors
/// When `GStreamer` cannot be used at all.
pub fn missing_elements<'a>(names: &[&'a str]) -> Result<Vec<&'a str>, Fault> {
    gst::init().map_err(|error| gstreamer_fault("start", &error))?;
    let is_missing = |name: &&&str| gst::ElementFactory::find(name).is_none();
    Ok(names.iter().filter(is_missing).copied().collect())
}

/// The codecs that something decodes here that may.
///
/// # Errors
/// When `GStreamer` cannot be used at all.
pub fn decoded_codecs() -> Result<Vec<Codec>, Fault> {
    gst::init().map_err(|error| gstreamer_fault("start", &error))?;
    let kind = gst::ElementFactoryType::DECODER | gst::ElementFactoryType::MEDIA_VIDEO;
    let image = gst::ElementFactoryType::DECODER | gst::ElementFactoryType::MEDIA_IMAGE;
    let mut factories: Vec<_> =
        gst::ElementFactory::factories_with_type(kind, gst::Rank::MARGINAL).into_iter().collect();
    factories.extend(gst::ElementFactory::factories_with_type(image, gst::Rank::MARGINAL));
    let is_decoded = |codec: &Codec| {
        let caps = gst::Caps::new_empty_simple(codec.caps());
        factories.iter().any(|factory| is_allowed(factory, Keep::Newest) && factory.can_sink_any_caps(&caps))
    };
    Ok(Codec::ALL.into_iter().filter(is_decoded).collect())
}
