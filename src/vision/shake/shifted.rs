//! Pictures and masks that are shifted by whole pixels.

use super::Shift;
use crate::frame::{BufferPool, Mask, Plane, YuvImage, YuvLayout};
use std::sync::Arc;

/// Columns (or rows) of a plane of `length` that stay within it when content is taken from `shift` farther on.
fn kept(length: usize, shift: i32) -> std::ops::Range<usize> {
    let first = (-i64::from(shift)).clamp(0, length as i64) as usize;
    let end = (length as i64 - i64::from(shift)).clamp(0, length as i64) as usize;
    first..end.max(first)
}

/// Fills `out` (rows of `width`) with a plane's content from `shift` farther on, and with `beyond` where the plane ends.
fn shift_plane(plane: Plane<'_>, beyond: Plane<'_>, shift: Shift, out: &mut [u8], stride: usize) {
    let (width, height) = (plane.width as usize, plane.height as usize);
    let (columns, rows) = (kept(width, shift.x), kept(height, shift.y));
    for (y, out) in out.chunks_mut(stride).take(height).enumerate() {
        let out = &mut out[..width];
        if !rows.contains(&y) || columns.is_empty() {
            out.copy_from_slice(&beyond.row(y as u32)[..width]);
            continue;
        }
        let from = plane.row((y as i64 + i64::from(shift.y)) as u32);
        let first = (columns.start as i64 + i64::from(shift.x)) as usize;
        let beyond = &beyond.row(y as u32)[..width];
        out[..columns.start].copy_from_slice(&beyond[..columns.start]);
        out[columns.clone()].copy_from_slice(&from[first..first + columns.len()]);
        out[columns.end..].copy_from_slice(&beyond[columns.end..]);
    }
}

/// Returns a picture whose content is where it belongs, in memory of `pool`: taken from `shift` farther on, and from the background
/// where the picture ends. Chroma is shifted by half, to the nearer whole pixel.
///
/// # Panics
/// When the background is not of the picture's size.
#[must_use]
pub fn steadied(
    image: &YuvImage,
    background: [Plane<'_>; 3],
    shift: Shift,
    pool: &Arc<BufferPool>,
) -> YuvImage {
    let (width, height) = (image.width(), image.height());
    assert_eq!((background[0].width, background[0].height), (width, height), "one size");
    let layout = YuvLayout::packed(width, height);
    let mut data = pool.filled(YuvLayout::packed_len(width, height), 0);
    for (index, out) in layout.split_mut(&mut data).into_iter().enumerate() {
        let shift = if index == 0 {
            shift
        } else {
            let half = |of: i32| (f64::from(of) / 2.0).round() as i32;
            Shift { x: half(shift.x), y: half(shift.y) }
        };
        shift_plane(image.plane(index), background[index], shift, out, layout.strides[index]);
    }
    YuvImage::new(layout, image.matrix(), image.range(), data).expect("a packed layout fits its own length")
}

/// Returns a mask whose content is where the picture shows it, in memory of `pool`: a steadied picture's mask, shifted by `shift`. What
/// the picture does not show is 0.
#[must_use]
pub fn shifted_back(mask: &Mask, shift: Shift, pool: &Arc<BufferPool>) -> Mask {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let mut data = pool.filled(width * height, 0);
    let (columns, rows) = (kept(width, -shift.x), kept(height, -shift.y));
    if !columns.is_empty() {
        let first = (columns.start as i64 - i64::from(shift.x)) as usize;
        for y in rows {
            let from = mask.row((y as i64 - i64::from(shift.y)) as u32);
            data[y * width..][columns.clone()].copy_from_slice(&from[first..first + columns.len()]);
        }
    }
    Mask { width: mask.width, height: mask.height, data }
}
