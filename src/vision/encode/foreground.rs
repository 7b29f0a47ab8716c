//! A camera's picture as its background and what moves before it: messages in bytes, and back.
//!
//! A background comes first and again when it has changed; after it, for every frame, rectangles with what moves in them: a
//! mask of their pixels and a JPEG of their colours. Numbers are big-endian.
//!
//! | bytes | |
//! | --- | --- |
//! | 0..4 | `VFG1` |
//! | 4 | 1 a background, 2 a foreground |
//! | 6..8 | length of this header, 40: a later version may be longer |
//! | 8..16 | the frame's time, nanoseconds since 1970 UTC, signed |
//! | 16..24 | number of the message, one more each: what is missing was dropped |
//! | 24..28 | number of the background: its own, or the one that a foreground belongs to |
//! | 28..30, 30..32 | columns and rows of the whole picture |
//! | 32..36 | of a foreground, how many rectangles |
//! | 36..40 | bytes that follow |
//!
//! What follows of a background is a JPEG; of a foreground, for each rectangle: its left column, upper row, columns and rows
//! (two bytes each), its track's number (eight, 0 for none), bytes of its mask and of its JPEG (four each), its mask and its
//! JPEG. A mask is run lengths, row after row of the rectangle, in LEB128, alternately of background and of what moves, the
//! first of background.

#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;

use super::{EncodeError, jpeg_yuv};
use crate::clock::Timestamp;
use crate::frame::{Mask, YuvImage};

const MAGIC: &[u8; 4] = b"VFG1";

/// Bytes of a message's header, and of a rectangle's.
const HEADER_BYTES: usize = 40;
const RECTANGLE_BYTES: usize = 24;

/// Most pixels of all rectangles of a message together that are read, more than any camera has: each takes a byte of memory, and
/// millions of them a few bytes of a message.
const MAX_PIXELS: usize = 1 << 26;

/// The value of pixels that move, in a hard mask.
const MOVES: u8 = 255;

/// What every message says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForegroundHeader {
    /// The frame's time.
    pub time: Timestamp,
    /// Number of the message.
    pub sequence: u64,
    /// Number of the background.
    pub background: u32,
    /// Columns and rows of the whole picture.
    pub size_px: [u16; 2],
}

/// Part of a picture in which something moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingRectangle {
    /// Left column, upper row, columns and rows.
    pub rect: [u32; 4],
    /// The track of what moves, if it is followed.
    pub track: Option<u64>,
}

/// A message taken apart.
#[derive(Clone, Debug, PartialEq)]
pub enum ForegroundMessage<'a> {
    /// A background: its JPEG.
    Background(ForegroundHeader, &'a [u8]),
    /// What moves.
    Foreground(ForegroundHeader, Vec<ForegroundPart<'a>>),
}

/// What moves in one rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct ForegroundPart<'a> {
    /// Where, and what.
    pub of: MovingRectangle,
    /// For each of its pixels, row after row, whether it moves.
    pub mask: Vec<bool>,
    /// Its colours, a JPEG of the rectangle's size.
    pub jpeg: &'a [u8],
}

/// The message of a background.
///
/// # Errors
/// As [`jpeg_yuv`].
pub fn background_message(
    header: &ForegroundHeader,
    background: &YuvImage,
    quality: u8,
) -> Result<Vec<u8>, EncodeError> {
    Ok(begun(header, 1, 0, &jpeg_yuv(background, quality)?))
}

/// The message of what moves in `frame`, by `labels` of its size; rectangles are grown to even columns and rows.
///
/// # Errors
/// As [`jpeg_yuv`].
pub fn foreground_message(
    header: &ForegroundHeader,
    (frame, labels): (&YuvImage, &Mask),
    moving: &[MovingRectangle],
    quality: u8,
) -> Result<Vec<u8>, EncodeError> {
    let (mut body, mut n) = (Vec::new(), 0);
    for MovingRectangle { rect, track } in moving {
        let Some(rect) = grown(*rect, [frame.width(), frame.height()]) else { continue };
        let (mask, jpeg) = (runs(labels, rect), jpeg_yuv(&frame.cropped(rect), quality)?);
        write_part(&mut body, &MovingRectangle { rect, track: *track }, &mask, &jpeg);
        n += 1;
    }
    Ok(begun(header, 2, n, &body))
}

/// Writes a rectangle with the run lengths of its mask and its JPEG.
fn write_part(body: &mut Vec<u8>, of: &MovingRectangle, mask: &[u8], jpeg: &[u8]) {
    for side in of.rect {
        body.extend_from_slice(&(side as u16).to_be_bytes());
    }
    body.extend_from_slice(&of.track.unwrap_or(0).to_be_bytes());
    for piece in [mask, jpeg] {
        body.extend_from_slice(&(piece.len() as u32).to_be_bytes());
    }
    body.extend_from_slice(mask);
    body.extend_from_slice(jpeg);
}

fn begun(header: &ForegroundHeader, kind: u8, n_rectangles: u32, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + body.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[kind, 0, 0, HEADER_BYTES as u8]);
    bytes.extend_from_slice(&header.time.as_nanos().to_be_bytes());
    bytes.extend_from_slice(&header.sequence.to_be_bytes());
    bytes.extend_from_slice(&header.background.to_be_bytes());
    for side in header.size_px {
        bytes.extend_from_slice(&side.to_be_bytes());
    }
    bytes.extend_from_slice(&n_rectangles.to_be_bytes());
    bytes.extend_from_slice(&(body.len() as u32).to_be_bytes());
    bytes.extend_from_slice(body);
    bytes
}

/// A rectangle that begins at even columns and rows, within the picture; none where nothing of it is.
fn grown([x, y, width, height]: [u32; 4], [columns, rows]: [u32; 2]) -> Option<[u32; 4]> {
    let (right, lower) = (x.saturating_add(width).min(columns), y.saturating_add(height).min(rows));
    let (x, y) = (x & !1, y & !1);
    (right > x && lower > y && right <= u32::from(u16::MAX) && lower <= u32::from(u16::MAX))
        .then(|| [x, y, right - x, lower - y])
}

/// Run lengths of what moves in a rectangle.
fn runs(labels: &Mask, [x, y, width, height]: [u32; 4]) -> Vec<u8> {
    let rows = (y..y + height).map(|row| &labels.row(row)[x as usize..(x + width) as usize]);
    run_lengths(rows.flatten().map(|value| *value == MOVES))
}

/// Lengths of runs, alternately of what does not move and of what does.
fn run_lengths(moves: impl Iterator<Item = bool>) -> Vec<u8> {
    let (mut bytes, mut is_moving, mut length) = (Vec::new(), false, 0_u32);
    for moves in moves {
        if moves != is_moving {
            write_number(&mut bytes, length);
            (is_moving, length) = (!is_moving, 0);
        }
        length += 1;
    }
    write_number(&mut bytes, length);
    bytes
}

fn write_number(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Takes a message apart; none where it is none or not whole, where a rectangle lies outside the picture, and where all rectangles
/// together have more pixels than any camera.
#[must_use]
pub fn read_foreground(message: &[u8]) -> Option<ForegroundMessage<'_>> {
    let mut rest = Reader(message);
    if rest.take(4)? != MAGIC {
        return None;
    }
    let kind = rest.take(2)?[0];
    let n_header = usize::from(rest.u16()?);
    let time = Timestamp::from_nanos(rest.u64()?.cast_signed());
    let (sequence, background) = (rest.u64()?, rest.u32()?);
    let header = ForegroundHeader { time, sequence, background, size_px: [rest.u16()?, rest.u16()?] };
    let (n_rectangles, n_bytes) = (rest.u32()?, rest.u32()? as usize);
    rest.take(n_header.checked_sub(HEADER_BYTES)?)?;
    let mut body = Reader(rest.take(n_bytes)?);
    match kind {
        1 => Some(ForegroundMessage::Background(header, body.0)),
        2 => {
            let fits = n_rectangles as usize * RECTANGLE_BYTES <= n_bytes;
            let mut n_left = MAX_PIXELS;
            let parts = (0..n_rectangles).map(|_| part(&mut body, header.size_px, &mut n_left));
            let parts: Vec<_> = fits.then(|| parts.collect::<Option<_>>())??;
            Some(ForegroundMessage::Foreground(header, parts))
        }
        _ => None,
    }
}

/// Reads a rectangle of a picture; `n_left` pixels are left to it and those that follow.
fn part<'a>(body: &mut Reader<'a>, size_px: [u16; 2], n_left: &mut usize) -> Option<ForegroundPart<'a>> {
    let mut side = || body.u16().map(u32::from);
    let rect @ [x, y, width, height] = [side()?, side()?, side()?, side()?];
    let [columns, rows] = size_px.map(u32::from);
    if x + width > columns || y + height > rows {
        return None;
    }
    let track = Some(body.u64()?).filter(|track| *track != 0);
    let (n_mask, n_jpeg) = (body.u32()? as usize, body.u32()? as usize);
    let mut lengths = Reader(body.take(n_mask)?);
    let n_pixels = width as usize * height as usize;
    *n_left = n_left.checked_sub(n_pixels)?;
    let (mut mask, mut is_moving) = (Vec::with_capacity(n_pixels), false);
    while !lengths.0.is_empty() {
        let end = mask.len() + lengths.number()?;
        if end > n_pixels {
            return None;
        }
        mask.resize(end, is_moving);
        is_moving = !is_moving;
    }
    let of = MovingRectangle { rect, track };
    (mask.len() == n_pixels).then_some(ForegroundPart { of, mask, jpeg: body.take(n_jpeg)? })
}

/// Bytes that are read from the front.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn u16(&mut self) -> Option<u16> {
        Some(u16::from_be_bytes(self.take(2)?.try_into().ok()?))
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_be_bytes(self.take(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_be_bytes(self.take(8)?.try_into().ok()?))
    }

    fn number(&mut self) -> Option<usize> {
        let mut number = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.take(1)?[0];
            number |= usize::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, RgbImage};

    const SIZE: [u32; 2] = [64, 48];

    fn header(background: u32) -> ForegroundHeader {
        let time = Timestamp::from_nanos(1_700_000_000_123_456_789);
        ForegroundHeader { time, sequence: 7, background, size_px: SIZE.map(|side| side as u16) }
    }

    /// A soft picture, so that what JPEG leaves is small; brighter where `is_bright`.
    fn picture(is_bright: impl Fn(u32, u32) -> bool) -> YuvImage {
        let [width, height] = SIZE;
        let pixel = |x: u32, y: u32| match is_bright(x, y) {
            true => [220 - x as u8, 180, 60 + y as u8],
            false => [x as u8 * 2, 90, 200 - y as u8],
        };
        let data = (0..height).flat_map(|y| (0..width).flat_map(move |x| pixel(x, y))).collect();
        YuvImage::from_rgb(&RgbImage { width, height, data }, ColorMatrix::Bt601, ColorRange::Full).unwrap()
    }

    fn decoded(jpeg: &[u8]) -> image::RgbImage {
        image::load_from_memory(jpeg).unwrap().into_rgb8()
    }

    #[test]
    fn a_frame_is_put_together_again_from_its_background_and_what_moves() {
        let is_moving = |x: u32, y: u32| (20..41).contains(&x) && (11..30).contains(&y) && x + y > 36;
        let (background, frame) = (picture(|_, _| false), picture(is_moving));
        let mut labels = Mask::filled(SIZE[0], SIZE[1], 0);
        for (x, y) in (0..SIZE[0]).flat_map(|x| (0..SIZE[1]).map(move |y| (x, y))) {
            let shadow = if (15..20).contains(&x) { 50 } else { 0 };
            labels.data[(y * SIZE[0] + x) as usize] = if is_moving(x, y) { 255 } else { shadow };
        }
        let first = background_message(&header(3), &background, 88).unwrap();
        let moving = [
            MovingRectangle { rect: [15, 11, 26, 19], track: Some(9) },
            MovingRectangle { rect: [61, 45, 20, 20], track: None },
            MovingRectangle { rect: [90, 0, 5, 5], track: None },
        ];
        let second = foreground_message(&header(3), (&frame, &labels), &moving, 88).unwrap();
        let Some(ForegroundMessage::Background(read, jpeg)) = read_foreground(&first) else { panic!() };
        assert_eq!(read, header(3));
        let shown = decoded(jpeg);
        let Some(ForegroundMessage::Foreground(read, parts)) = read_foreground(&second) else { panic!() };
        assert_eq!((read, parts.len()), (header(3), 2));
        assert_eq!((parts[0].of.rect, parts[0].of.track), ([14, 10, 27, 20], Some(9)));
        assert_eq!((parts[1].of.rect, parts[1].of.track), ([60, 44, 4, 4], None));
        let mut together = shown.clone();
        for ForegroundPart { of: MovingRectangle { rect: [x, y, width, _], .. }, mask, jpeg } in &parts {
            let colors = decoded(jpeg);
            for (idx, _) in mask.iter().enumerate().filter(|(_, moves)| **moves) {
                let (i, j) = (idx as u32 % width, idx as u32 / width);
                together.put_pixel(x + i, y + j, *colors.get_pixel(i, j));
            }
        }
        // Outside what moves it is the background to the bit, inside the frame but for what its JPEG leaves.
        let wanted = frame.to_rgb();
        let (mut n_moving, mut error_sum) = (0, 0);
        for (x, y, pixel) in together.enumerate_pixels() {
            if !is_moving(x, y) {
                assert_eq!(pixel, shown.get_pixel(x, y), "{x}, {y}");
                continue;
            }
            let at = 3 * (y * SIZE[0] + x) as usize;
            let errors = pixel.0.iter().zip(&wanted.data[at..at + 3]).map(|(a, b)| u32::from(a.abs_diff(*b)));
            n_moving += 3;
            error_sum += errors.sum::<u32>();
        }
        assert!(n_moving > 500 && error_sum < 6 * n_moving, "{error_sum} over {n_moving} codes");
    }

    #[test]
    fn a_short_message_does_not_stand_for_more_pixels_than_a_camera_has() {
        let of = |n: u32, [width, height]: [u16; 2]| {
            let (mut body, n_pixels) = (Vec::new(), u32::from(width) * u32::from(height));
            let mut lengths = Vec::new();
            write_number(&mut lengths, n_pixels);
            let rect = [0, 0, u32::from(width), u32::from(height)];
            for _ in 0..n {
                write_part(&mut body, &MovingRectangle { rect, track: None }, &lengths, &[]);
            }
            begun(&ForegroundHeader { size_px: [width, height], ..header(1) }, 2, n, &body)
        };
        // Each of them is read alone.
        assert!(read_foreground(&of(1, [8192, 8192])).is_some());
        assert!(read_foreground(&of(4, [4096, 4096])).is_some());
        assert_eq!(read_foreground(&of(5, [4096, 4096])), None, "more than a camera has together");
        let many = of(1000, [8192, 8192]);
        assert!(many.len() < 30_000);
        assert_eq!(read_foreground(&many), None);
    }

    #[test]
    fn what_lies_outside_the_picture_is_no_rectangle() {
        let of = |rect: [u32; 4]| {
            let mut body = Vec::new();
            write_part(
                &mut body,
                &MovingRectangle { rect, track: None },
                &[rect[2] as u8 * rect[3] as u8],
                &[],
            );
            read_foreground(&begun(&header(1), 2, 1, &body)).is_some()
        };
        assert!(of([60, 44, 4, 4]) && of([0, 48, 9, 0]));
        assert!(!of([62, 44, 4, 4]) && !of([60, 46, 4, 4]) && !of([65_535, 0, 1, 1]));
    }

    #[test]
    fn what_is_cut_or_changed_is_no_message() {
        let labels = Mask::filled(SIZE[0], SIZE[1], 255);
        let frame = picture(|_, _| true);
        let moving = [MovingRectangle { rect: [0, 0, 64, 48], track: Some(1) }];
        let message = foreground_message(&header(1), (&frame, &labels), &moving, 50).unwrap();
        assert!(read_foreground(&message).is_some());
        for n_bytes in 0..message.len() {
            assert_eq!(read_foreground(&message[..n_bytes]), None, "{n_bytes}");
        }
        for place in 0..100 {
            for value in [0, 0x7f, 0x80, 0xff] {
                let mut changed = message.clone();
                changed[place] = value;
                // It is read as something or not at all: never beyond its end.
                drop(read_foreground(&changed));
            }
        }
    }
}
