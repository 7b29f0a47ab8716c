//! From a frame and its background to soft masks and blobs.

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
}
