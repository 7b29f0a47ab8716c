//! Every pixel's background as a mixture of Gaussians.
//!
//! Owns the mixture of one camera at one picture size ([`GaussianMixture`]), its parameters and its checkpoint.
//! Pictures and the time between them flow in; which pixels match the background, and the background picture, flow
//! out. Knows nothing of where pictures come from, of clips, of holding, or of what is done with the answer.
//!
//! This is the scalar twin: exact, readable, f32. A faster form is measured against it.
//!
//! `[SG99]` Stauffer and Grimson 1999, Adaptive background mixture models for real-time tracking.
//! `[Z04]` Zivkovic 2004, Improved adaptive Gaussian mixture model for background subtraction.
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 1 to 3.

mod checkpoint;
mod light;
mod mixture;
mod pixel;

pub use mixture::{GaussianMixture, Update};

use crate::error::ErrorKind;
use crate::frame::{ColorMatrix, ColorRange};
use std::fmt;

/// What a model was made for: it is never applied to anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Columns of the luma plane.
    pub width: u32,
    /// Rows of the luma plane.
    pub height: u32,
    /// Which matrix relates YUV and RGB.
    pub matrix: ColorMatrix,
    /// Which codes stand for black and white.
    pub range: ColorRange,
}

impl Format {
    /// The format of `image`.
    #[must_use]
    pub const fn of(image: &crate::frame::YuvImage) -> Self {
        Self { width: image.width(), height: image.height(), matrix: image.matrix(), range: image.range() }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} x {} {:?} {:?}", self.width, self.height, self.matrix, self.range)
    }
}

/// Why a model could not be used.
#[derive(Debug, thiserror::Error)]
pub enum BackgroundError {
    /// The picture is of another size or colour than the model: keep the model aside and begin another.
    #[error("the background model is for {model}, the picture is {picture}")]
    Mismatch {
        /// What the model was made for.
        model: Format,
        /// What the picture is.
        picture: Format,
    },
    /// The checkpoint was made with another number of modes.
    #[error("the checkpoint has {found} modes a pixel, the settings ask for {expected}")]
    Modes {
        /// Modes in the checkpoint.
        found: usize,
        /// Modes in the settings.
        expected: usize,
    },
    /// The bytes are no checkpoint of this version, or are damaged.
    #[error("not a usable background checkpoint: {reason}")]
    Checkpoint {
        /// What is wrong, lower case.
        reason: String,
    },
    /// Compression failed or the compressed bytes are damaged.
    #[error("background checkpoint cannot be read or written")]
    Compression(#[from] std::io::Error),
}

impl BackgroundError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Mismatch { .. } | Self::Modes { .. } | Self::Checkpoint { .. } => ErrorKind::Invalid,
            Self::Compression(_) => ErrorKind::Internal,
        }
    }
}
