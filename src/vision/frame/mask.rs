//! One byte a pixel: how much of it is foreground.

use super::buffer::{Buffer, BufferPool};
use std::sync::Arc;

/// Foreground share of every pixel.
///
/// **Shape** `height * width` bytes, row-major, rows from the top, no padding. **Range** 0 background to 255
/// foreground; a soft mask uses what lies between, a hard one only the ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` values.
    pub data: Buffer,
}

impl Mask {
    /// A mask with every value `value`.
    #[must_use]
    pub fn filled(width: u32, height: u32, value: u8) -> Self {
        Self { width, height, data: vec![value; width as usize * height as usize].into() }
    }

    /// The same, in memory of `pool`.
    #[must_use]
    pub fn filled_of(pool: &Arc<BufferPool>, (width, height): (u32, u32), value: u8) -> Self {
        Self { width, height, data: pool.filled(width as usize * height as usize, value) }
    }

    /// Row `y`, `width` values.
    #[must_use]
    pub fn row(&self, y: u32) -> &[u8] {
        let start = y as usize * self.width as usize;
        &self.data[start..start + self.width as usize]
    }

    /// The value at column `x`, row `y`.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> u8 {
        self.data[y as usize * self.width as usize + x as usize]
    }
}
