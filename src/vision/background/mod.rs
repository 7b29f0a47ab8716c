//! Every pixel's background as a mixture of Gaussians.
//!
//! Owns the mixture of one camera at one picture size ([`GaussianMixture`]), its parameters and its checkpoint.
//! Pictures and the time between them flow in; which pixels match the background, and the background picture, flow
//! out. Knows nothing of where pictures come from, of clips, of holding, or of what is done with the answer.
//!
//! Two forms of it: [`GaussianMixture`], compact and vectorised, is the one in use; [`ReferenceMixture`], scalar, in f32
//! and readable, is what it is held to. Inside: one pixel's formulas (`pixel`), how fast to learn (`pace`, `light`), the
//! fast form's inner loop (`band`, `kernel`, `visit`, `tile`), its picture (`mixture`) and its bytes (`checkpoint`). Where
//! a model is of a reduced picture, [`Detail`] makes a full one of its background.
//!
//! `[SG99]` Stauffer and Grimson 1999, Adaptive background mixture models for real-time tracking.
//! `[Z04]` Zivkovic 2004, Improved adaptive Gaussian mixture model for background subtraction.
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 1 to 3.

mod band;
mod checkpoint;
mod detail;
mod gain;
mod kernel;
mod light;
mod mixture;
mod pace;
mod pixel;
mod reference;
mod rows;
mod tile;
mod visit;

#[cfg(test)]
mod pictures;

pub use detail::Detail;
pub use gain::gain_of;
pub use mixture::{GaussianMixture, Hints, simd_levels};
pub use reference::ReferenceMixture;

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

/// What one frame did to a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// Share of the new frame in its pixels' weights, 0 to 1.
    pub learning_rate: f64,
    /// Share of the pixels that matched no background mode, 0 to 1.
    pub foreground_share: f64,
    /// Share of the picture whose modes all had to be looked at, 0 to 1: what the frame cost.
    pub visited_share: f64,
    /// Most of the picture has been foreground for more than a few frames: from now on the model learns as fast as
    /// at its start. True once a change.
    pub light_changed: bool,
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
