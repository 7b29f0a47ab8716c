//! From a frame and its background to soft masks and blobs.
//!
//! A frame, its background picture and the mixture's own verdict flow in; a soft mask, a hard one and its connected
//! pieces flow out. Knows nothing of how backgrounds are learned, of cameras in the world, or of time.
//!
//! The stages, one file each: what most of the mixture's verdicts say (`majority`), signed difference and norm
//! (`difference`), one verdict a pixel (`label`) by the noise that is there (`noise`) and how
//! often it turns (`flicker`), what of it is shadow (`shadow`, `shadow_direction`), shadow that must be body (`repair`), holes and gaps (`fill`), pieces
//! (`components`), which of them blink (`blink`) or are several (`split`), outlines (`contour`), what they are outlines of
//! (`edges`, `gaps`), what is handed out (`soft`), their order (`segmenter`), and the way back from a reduced picture
//! (`enlarge`). Beside them: how far pixels lie inside (`distance`), and how large objects are by where they stand (`object_sizes`).

mod blink;
mod components;
mod contour;
mod difference;
mod dilate;
mod distance;
#[cfg(test)]
mod drawn;
mod edges;
mod enlarge;
mod fill;
mod flicker;
mod gaps;
mod given;
mod label;
mod majority;
mod memory;
mod noise;
mod object_sizes;
mod repair;
mod segmenter;
mod shadow;
mod shadow_direction;
mod soft;
mod split;
mod stages;

pub use dilate::dilate;
pub use distance::{DistanceTransform, NO_OUTSIDE};
pub use edges::{OutlineOf, outline_of};
pub use gaps::GapFinder;
pub use given::blobs_of;
pub use memory::Memory;
pub use object_sizes::{ObjectSize, ObjectSizes};
pub use segmenter::{Segmentation, Segmenter};

use std::sync::Arc;

/// Label of a background pixel.
pub const BACKGROUND: u8 = 0;

/// Label of a pixel whose background lies in a moving thing's shadow.
pub const SHADOW: u8 = 50;

/// Label of a pixel of a moving thing.
pub const MOVING: u8 = 255;

/// A rectangle in pixels: columns `x .. x + width`, rows `y .. y + height`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PixelRect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// One connected piece of foreground in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob {
    /// The smallest rectangle around it.
    pub rect: PixelRect,
    /// Its pixels.
    pub area_px: u32,
    /// Its lowest contact with the ground: middle column of its lowest row, at that row's lower edge, in pixels
    /// with pixel centres at +0.5.
    pub foot_in_image: [f64; 2],
    /// Whether it touches the picture's lower, left or right border, so that its foot may lie outside.
    pub is_truncated: bool,
    /// Its outline: corners of pixels, (0, 0) being the picture's upper left, clockwise from the upper left corner of its
    /// first pixel; neighbours in the list share a column or a row, and so do the last and the first. Holes have none.
    /// Of a blob that was parted from another and has come apart, the largest piece's.
    pub contour: Arc<[[u16; 2]]>,
}
