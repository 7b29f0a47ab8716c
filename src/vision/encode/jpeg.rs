//! JPEG: from sRGB, or straight from a camera's own planes.
//!
//! A camera frame is encoded from its planes: JPEG stores full-range BT.601 with halved chroma (JFIF), which is
//! what most frames already are but for the range, so neither RGB nor new chroma samples are computed.

use super::{EncodeError, check_size};
use crate::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage};
use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, ImageBuffer, JpegColorType, SamplingFactor};

/// `picture` as a JPEG of `quality` 1 (smallest) to 100 (best); chroma is halved below 90.
///
/// # Errors
/// When the quality is out of range, or the picture has no pixels, more than 65535 a side, or not as many as its
/// size promises.
pub fn jpeg(picture: &RgbImage, quality: u8) -> Result<Vec<u8>, EncodeError> {
    check_size(picture.width, picture.height, 3, picture.data.len())?;
    let (width, height) = sides(picture.width, picture.height)?;
    let mut bytes = Vec::with_capacity(picture.data.len() / 12 + 1024);
    encoder(&mut bytes, quality)?.encode(&picture.data, width, height, ColorType::Rgb)?;
    Ok(bytes)
}

/// A camera frame as a JPEG of `quality` 1 (smallest) to 100 (best), its chroma halved as it came.
///
/// # Errors
/// When the quality is out of range, or the frame has more than 65535 pixels a side.
pub fn jpeg_yuv(frame: &YuvImage, quality: u8) -> Result<Vec<u8>, EncodeError> {
    if frame.matrix() != ColorMatrix::Bt601 {
        return jpeg(&frame.to_rgb(), quality);
    }
    let (width, height) = sides(frame.width(), frame.height())?;
    let mut bytes = Vec::with_capacity(frame.len_bytes() / 8 + 1024);
    let mut encoder = encoder(&mut bytes, quality)?;
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    // The encoder wants chroma at full size and halves it again: the nearest sample is the one that was repeated.
    encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Nearest);
    let (luma, chroma) = to_full_range(frame.range());
    encoder.encode_image(Planes { frame, width, height, luma, chroma })?;
    Ok(bytes)
}

fn encoder(bytes: &mut Vec<u8>, quality: u8) -> Result<Encoder<&mut Vec<u8>>, EncodeError> {
    if (1..=100).contains(&quality) {
        Ok(Encoder::new(bytes, quality))
    } else {
        Err(EncodeError::Quality { quality })
    }
}

fn sides(width: u32, height: u32) -> Result<(u16, u16), EncodeError> {
    match (u16::try_from(width), u16::try_from(height)) {
        (Ok(width), Ok(height)) => Ok((width, height)),
        _ => Err(EncodeError::TooLarge { width, height }),
    }
}

/// A camera's planes as the encoder reads them.
struct Planes<'a> {
    frame: &'a YuvImage,
    width: u16,
    height: u16,
    luma: [u8; 256],
    chroma: [u8; 256],
}

impl ImageBuffer for Planes<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }

    fn width(&self) -> u16 {
        self.width
    }

    fn height(&self) -> u16 {
        self.height
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let [luma, u, v, _] = buffers;
        let y = u32::from(y);
        luma.extend(self.frame.plane(0).row(y).iter().map(|code| self.luma[usize::from(*code)]));
        let width = usize::from(self.width);
        for (plane, buffer) in [(1, u), (2, v)] {
            let row = self.frame.plane(plane).row(y / 2);
            let twice = row.iter().flat_map(|code| [self.chroma[usize::from(*code)]; 2]);
            buffer.extend(twice.take(width));
        }
    }
}

/// What a code of luma and of chroma becomes in full range.
fn to_full_range(range: ColorRange) -> ([u8; 256], [u8; 256]) {
    let (luma_offset, luma_scale, chroma_scale) = range.luma_offset_luma_scale_chroma_scale();
    let table = |map: &dyn Fn(f32) -> f32| std::array::from_fn(|code| map(code as f32).round() as u8);
    let luma = table(&|code| (code - luma_offset) * 255.0 / luma_scale);
    let chroma = table(&|code| (code - 128.0) * 255.0 / chroma_scale + 128.0);
    (luma, chroma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    /// A soft gradient, so that what differs is the encoder's doing and not that of sharp edges.
    fn gradient(width: u32, height: u32) -> RgbImage {
        let code = |value: u32, most: u32| (value * 255 / most.max(1)) as u8;
        let pixel = |x, y| [code(x, width - 1), code(y, height - 1), code(x + y, width + height - 2)];
        let data = (0..height).flat_map(|y| (0..width).flat_map(move |x| pixel(x, y))).collect();
        RgbImage { width, height, data }
    }

    fn worst_difference(bytes: &[u8], expected: &RgbImage) -> u8 {
        let read = image::load_from_memory(bytes).unwrap().into_rgb8();
        assert_eq!((read.width(), read.height()), (expected.width, expected.height));
        read.as_raw().iter().zip(&expected.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    }

    #[test]
    fn a_good_jpeg_differs_little_and_a_small_one_more() {
        for (width, height) in [(96, 64), (33, 17), (1, 1)] {
            let picture = gradient(width, height);
            let good = jpeg(&picture, 100).unwrap();
            assert!(worst_difference(&good, &picture) <= 8, "{width} x {height}");
        }
        let picture = gradient(96, 64);
        assert!(jpeg(&picture, 20).unwrap().len() < jpeg(&picture, 95).unwrap().len());
    }

    #[test]
    fn a_frames_planes_encode_like_its_rgb_picture() {
        for (width, height) in [(96, 64), (33, 17), (2, 2), (1, 1)] {
            for matrix in [ColorMatrix::Bt601, ColorMatrix::Bt709] {
                for range in [ColorRange::Limited, ColorRange::Full] {
                    let frame = YuvImage::from_rgb(&gradient(width, height), matrix, range).unwrap();
                    let worst = worst_difference(&jpeg_yuv(&frame, 100).unwrap(), &frame.to_rgb());
                    assert!(worst <= 16, "{width} x {height} {matrix:?} {range:?}: {worst}");
                }
            }
        }
    }

    #[test]
    fn codes_outside_the_limited_range_become_black_and_white() {
        let (luma, chroma) = to_full_range(ColorRange::Limited);
        assert_eq!((luma[0], luma[16], luma[235], luma[255]), (0, 0, 255, 255));
        assert_eq!((chroma[0], chroma[16], chroma[128], chroma[240], chroma[255]), (0, 1, 128, 255, 255));
        let (luma, chroma) = to_full_range(ColorRange::Full);
        assert!(
            (0..=255_u8).all(|code| luma[usize::from(code)] == code && chroma[usize::from(code)] == code)
        );
    }

    #[test]
    fn what_jpeg_cannot_hold_is_refused() {
        let kind = |picture: &RgbImage, quality| jpeg(picture, quality).unwrap_err().kind();
        for quality in [0, 101, 255] {
            assert_eq!(kind(&gradient(8, 8), quality), ErrorKind::Invalid);
        }
        let sized = |width: u32, height: u32| RgbImage {
            width,
            height,
            data: vec![0; (width * height * 3) as usize],
        };
        assert_eq!(kind(&sized(0, 1), 80), ErrorKind::Invalid);
        assert_eq!(kind(&sized(65_536, 1), 80), ErrorKind::TooLarge);
        assert!(jpeg(&sized(65_535, 1), 80).is_ok());
        assert_eq!(kind(&RgbImage { width: 8, height: 8, data: vec![0; 191] }, 80), ErrorKind::Internal);
    }
}
