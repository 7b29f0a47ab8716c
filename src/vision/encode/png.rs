//! PNG: exact, compressed fast (fdeflate).

use super::{EncodeError, check_size};
use crate::frame::{Mask, RgbImage};
use png::{BitDepth, ColorType, Compression, Encoder, SrgbRenderingIntent};

/// `picture` as an 8-bit sRGB PNG.
///
/// # Errors
/// When the picture has no pixels, or not as many as its size promises.
pub fn png_rgb(picture: &RgbImage) -> Result<Vec<u8>, EncodeError> {
    check_size(picture.width, picture.height, 3, picture.data.len())?;
    encode(picture.width, picture.height, ColorType::Rgb, &picture.data)
}

/// `mask` as an 8-bit grey PNG, its values as they are.
///
/// # Errors
/// When the mask has no pixels, or not as many as its size promises.
pub fn png_gray(mask: &Mask) -> Result<Vec<u8>, EncodeError> {
    check_size(mask.width, mask.height, 1, mask.data.len())?;
    encode(mask.width, mask.height, ColorType::Grayscale, &mask.data)
}

fn encode(width: u32, height: u32, color: ColorType, data: &[u8]) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::with_capacity(data.len() / 2 + 1024);
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fastest);
    // Mask values are no light: only pictures say how they are meant to look.
    if color == ColorType::Rgb {
        encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn pictures_and_masks_come_back_exactly() {
        let data: Vec<u8> = (0..7 * 5 * 3).map(|n| (n * 37 % 256) as u8).collect();
        let rgb = RgbImage { width: 7, height: 5, data: data.clone() };
        let read = image::load_from_memory(&png_rgb(&rgb).unwrap()).unwrap();
        assert_eq!(read.as_rgb8().unwrap().as_raw(), &data);

        let mask = Mask { width: 7, height: 5, data: data[..35].to_vec().into() };
        let read = image::load_from_memory(&png_gray(&mask).unwrap()).unwrap();
        assert_eq!(read.as_luma8().unwrap().as_raw(), &*mask.data);
    }

    #[test]
    fn pictures_that_are_none_are_refused() {
        let error = |width, height, n: usize| {
            let rgb = png_rgb(&RgbImage { width, height, data: vec![0; 3 * n] }).unwrap_err();
            let gray = png_gray(&Mask { width, height, data: vec![0; n].into() }).unwrap_err();
            assert_eq!(rgb.kind(), gray.kind());
            rgb.kind()
        };
        assert_eq!(error(0, 5, 0), ErrorKind::Invalid);
        assert_eq!(error(5, 0, 0), ErrorKind::Invalid);
        assert_eq!(error(2, 2, 3), ErrorKind::Internal);
        assert_eq!(error(2, 2, 5), ErrorKind::Internal);
    }
}
