//! Pictures as cameras deliver them: identified, timed, in the decoder's own YUV planes.
//!
//! Owns `Frame`, `YuvImage`, `Mask`, `BitMask`, `RgbImage`, the buffers that their memory goes round in, the one conversion between YUV and sRGB,
//! and what nobody may see of a picture (`zones`). Knows nothing of where frames come from or what is done with them.

mod bits;
mod blur;
mod buffer;
mod color;
mod crop;
mod gains;
mod histogram;
mod light;
mod mask;
mod reduce;
mod yuv;
mod zones;

pub use bits::{BitMask, WORD_PIXELS, inside};
pub use blur::{BLUR_CELLS, BLUR_MARGIN_SHARE, Blur, BlurRegion, LEAST_BLUR_CELL_PX, LEAST_BLUR_MARGIN_PX};
pub use buffer::{Buffer, BufferPool};
pub use color::{ColorMatrix, ColorRange, linear_from_srgb, srgb_from_linear};
pub use gains::{Difference, log_gains};
pub use histogram::quantile;
pub use light::{Levels, codes_of, lab_of};
pub use mask::Mask;
pub use yuv::{Plane, YuvError, YuvImage, YuvLayout};
pub use zones::{MAX_ZONES, NEUTRAL_YUV, Zone, ZoneMask, check_zones, polygon_holds};

use crate::clock::Timestamp;
use std::borrow::Borrow;
use std::fmt;
use std::sync::Arc;

/// Identifies one camera: 1 to 64 characters of `a-z`, `0-9`, `-` and `_`, beginning with a letter or digit.
///
/// Restricting the alphabet here keeps log lines, metric labels, file names and URLs safe everywhere else.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CameraId(Arc<str>);

/// A camera id that does not keep to the alphabet.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an id has 1 to 64 characters of a-z, 0-9, - and _ and begins with a letter or digit")]
pub struct IdError;

/// Whether `text` may stand as the id of a camera or scene.
#[must_use]
pub fn is_id(text: &str) -> bool {
    let bytes = text.as_bytes();
    (1..=64).contains(&bytes.len())
        && bytes.iter().all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_'))
        && bytes[0].is_ascii_alphanumeric()
}

impl CameraId {
    /// Takes `text` as an id.
    ///
    /// # Errors
    /// When `text` does not keep to the alphabet.
    pub fn new(text: &str) -> Result<Self, IdError> {
        if is_id(text) { Ok(Self(text.into())) } else { Err(IdError) }
    }

    /// The id as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for CameraId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl Borrow<str> for CameraId {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl<'de> serde::Deserialize<'de> for CameraId {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Self::new(&text).map_err(|error| serde::de::Error::custom(format!("invalid id {text:?}: {error}")))
    }
}

impl serde::Serialize for CameraId {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

/// One picture of one camera at one time. Cheap to clone: the pixels are shared.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The camera that saw it.
    pub camera: CameraId,
    /// Scene time at which it was seen.
    pub timestamp: Timestamp,
    /// Number of the frame in its input, from 0; counts on through loops.
    pub number: u64,
    /// The pixels.
    pub image: Arc<YuvImage>,
}

/// 8-bit sRGB picture: `height * width * 3` bytes, rows from the top, no padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width * 3` bytes, R, G, B.
    pub data: Vec<u8>,
}
