//! Pictures to bytes: JPEG and PNG, and what moves in them.
//!
//! In: sRGB pictures, masks, camera frames. Out: whole files in memory, written fast rather than small, since most
//! are looked at once. Knows nothing of who asks for them.

mod foreground;
mod jpeg;
mod png;

pub use self::png::{png_gray, png_rgb};
pub use foreground::{
    ForegroundHeader, ForegroundMessage, ForegroundPart, MovingRectangle, background_message,
    foreground_message, read_foreground,
};
pub use jpeg::{jpeg, jpeg_yuv};

#[cfg(any(test, feature = "fuzzing"))]
pub(crate) use foreground::fuzzing;

use crate::error::ErrorKind;

/// The file formats of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PictureFormat {
    /// JPEG, lossy.
    Jpeg,
    /// PNG, exact.
    Png,
}

impl PictureFormat {
    /// The media type, for HTTP.
    #[must_use]
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::Jpeg => "image/jpeg",
            Self::Png => "image/png",
        }
    }

    /// The end of file names, without its dot.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Jpeg => "jpg",
            Self::Png => "png",
        }
    }

    /// The format that a file name's end stands for, whatever its case: `jpg`, `jpeg` or `png`.
    #[must_use]
    pub fn from_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "jpg" | "jpeg" => Some(Self::Jpeg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }
}

/// A picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// A quality out of range.
    #[error("JPEG quality must be 1 to 100, got {quality}")]
    Quality {
        /// The quality as asked for.
        quality: u8,
    },
    /// No pixels.
    #[error("a picture of {width} x {height} pixels cannot be encoded")]
    Empty {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// More pixels a side than the format can tell.
    #[error("JPEG pictures have at most 65535 pixels a side, got {width} x {height}")]
    TooLarge {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The pixels are not as many as the size promises.
    #[error("a picture of {width} x {height} pixels needs {needed} bytes, got {available}")]
    Length {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes that the size promises.
        needed: usize,
        /// Bytes that are there.
        available: usize,
    },
    /// The JPEG encoder fails.
    #[error("cannot encode a JPEG: {0}")]
    Jpeg(#[from] jpeg_encoder::EncodingError),
    /// The PNG encoder fails.
    #[error("cannot encode a PNG: {0}")]
    Png(#[from] ::png::EncodingError),
}

impl EncodeError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Quality { .. } | Self::Empty { .. } => ErrorKind::Invalid,
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::Length { .. } | Self::Jpeg(_) | Self::Png(_) => ErrorKind::Internal,
        }
    }
}

/// Refuses pictures without pixels and those whose bytes are not what their size promises.
fn check_size(width: u32, height: u32, bytes_per_pixel: usize, available: usize) -> Result<(), EncodeError> {
    if width == 0 || height == 0 {
        return Err(EncodeError::Empty { width, height });
    }
    let needed = width as usize * height as usize * bytes_per_pixel;
    if needed == available { Ok(()) } else { Err(EncodeError::Length { width, height, needed, available }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_extensions() {
        for format in [PictureFormat::Jpeg, PictureFormat::Png] {
            assert_eq!(PictureFormat::from_extension(format.extension()), Some(format));
            assert!(format.content_type().starts_with("image/"));
        }
        assert_eq!(PictureFormat::from_extension("JPEG"), Some(PictureFormat::Jpeg));
        assert_eq!(PictureFormat::from_extension("gif"), None);
    }
}
