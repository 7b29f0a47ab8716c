//! What rendering can fail with.

use crate::gpu::GpuError;
use videofields_vision::error::{ErrorKind, Fault};

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The device failed; see [`GpuError::is_lost`].
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The view is none, or too large.
    #[error("view: {0}")]
    View(Fault),
    /// The plan names cameras or entities that the state does not have.
    #[error("the plan was not made for this state: {0}")]
    Plan(String),
    /// A camera's picture is larger than the device takes.
    #[error("a camera's picture has {width} x {height} pixels, the GPU takes {limit} each way")]
    ImageSize {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Most columns or rows.
        limit: u32,
    },
    /// A soft mask that does not fit its frame.
    #[error("a soft mask has {mask:?} pixels, its frame {frame:?}")]
    MaskSize {
        /// Columns and rows of the mask.
        mask: (u32, u32),
        /// Columns and rows of the frame.
        frame: (u32, u32),
    },
    /// Too many of something for the device.
    #[error("{what}: {needed} are needed, the GPU takes {limit}")]
    TooMany {
        /// What there are too many of.
        what: &'static str,
        /// How many are needed.
        needed: u64,
        /// How many the device takes.
        limit: u64,
    },
    /// A plan that looks at pixels more or less often than there is a form for.
    #[error("{0}")]
    Sampling(Fault),
}

impl RenderError {
    /// What a caller can do about it. After `Unavailable` the renderer must be made anew.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Gpu(error) => error.kind(),
            Self::View(_) | Self::Sampling(_) => ErrorKind::Invalid,
            Self::Plan(_) | Self::MaskSize { .. } => ErrorKind::Internal,
            Self::ImageSize { .. } | Self::TooMany { .. } => ErrorKind::TooLarge,
        }
    }
}
