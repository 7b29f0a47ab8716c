//! What a file is by its first bytes, held against what its name says. Whether all of it is good a scene finds that names it.

use image::{ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use videofields_picture::scene::{MAX_TEXTURE_BYTES, MAX_TEXTURE_SIDE_PX};

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AssetFormat {
    /// A picture.
    Png,
    /// A picture.
    Jpeg,
    /// A model: binary glTF, all in one file.
    Glb,
    /// A model: the Stanford triangle format.
    Ply,
}

impl AssetFormat {
    pub(super) const ALL: [Self; 4] = [Self::Png, Self::Jpeg, Self::Glb, Self::Ply];

    /// The ends of such files' names, without their dots.
    pub(super) const fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Png => &["png"],
            Self::Jpeg => &["jpg", "jpeg"],
            Self::Glb => &["glb"],
            Self::Ply => &["ply"],
        }
    }

    /// The media type, for HTTP.
    #[must_use]
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
            Self::Glb => "model/gltf-binary",
            // It has none of its own.
            Self::Ply => "application/octet-stream",
        }
    }
}

/// Refuses bytes that do not begin as such a file does, and pictures that no scene takes.
pub(super) fn check(format: AssetFormat, bytes: &[u8]) -> Result<(), String> {
    match format {
        AssetFormat::Png => check_picture(bytes, ImageFormat::Png),
        AssetFormat::Jpeg => check_picture(bytes, ImageFormat::Jpeg),
        AssetFormat::Glb => check_glb(bytes),
        AssetFormat::Ply if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") => Ok(()),
        AssetFormat::Ply => Err("this is no PLY: it does not begin with `ply`".to_owned()),
    }
}

fn check_picture(bytes: &[u8], expected: ImageFormat) -> Result<(), String> {
    let reason = |error: image::ImageError| format!("this picture cannot be read: {error}");
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| format!("this picture cannot be read: {error}"))?;
    if reader.format() != Some(expected) {
        let name = if expected == ImageFormat::Png { "PNG" } else { "JPEG" };
        return Err(format!("this is no {name}, though the file's name says so"));
    }
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) =
        (Some(MAX_TEXTURE_SIDE_PX), Some(MAX_TEXTURE_SIDE_PX));
    reader.limits(limits);
    let (width, height) = reader.into_decoder().map_err(reason)?.dimensions();
    let is_large = width.max(height) > MAX_TEXTURE_SIDE_PX;
    if is_large || u64::from(width) * u64::from(height) * 4 > MAX_TEXTURE_BYTES {
        return Err(format!(
            "the picture has {width} x {height} pixels, at most {MAX_TEXTURE_SIDE_PX} a side and {} in all are taken",
            MAX_TEXTURE_BYTES / 4
        ));
    }
    Ok(())
}

/// The header of binary glTF 2.0: magic, version, length.
fn check_glb(bytes: &[u8]) -> Result<(), String> {
    let word =
        |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    if !bytes.starts_with(b"glTF") {
        return Err("this is no binary glTF: it does not begin with `glTF`".to_owned());
    }
    match (word(4), word(8)) {
        (Some(2), Some(length)) if length as usize == bytes.len() => Ok(()),
        (Some(2), Some(length)) => {
            Err(format!("the file says that it has {length} bytes, but {} came", bytes.len()))
        }
        (version, _) => {
            Err(format!("expected version 2 of binary glTF, got {}", version.unwrap_or_default()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image::RgbImage::from_pixel(6, 4, image::Rgb([9, 8, 7])).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn bytes_are_held_against_their_name() {
        let (png, jpeg) = (picture(ImageFormat::Png), picture(ImageFormat::Jpeg));
        check(AssetFormat::Png, &png).unwrap();
        check(AssetFormat::Jpeg, &jpeg).unwrap();
        check(AssetFormat::Ply, b"ply\nformat ascii 1.0\n").unwrap();
        let glb =
            |version: u8, length: u8| [b"glTF".as_slice(), &[version, 0, 0, 0, length, 0, 0, 0]].concat();
        check(AssetFormat::Glb, &glb(2, 12)).unwrap();
        let refuse = |format: AssetFormat, bytes: &[u8], said: &str| {
            let reason = check(format, bytes).unwrap_err();
            assert!(reason.contains(said), "{reason}");
        };
        refuse(AssetFormat::Png, &jpeg, "no PNG");
        refuse(AssetFormat::Jpeg, &png, "no JPEG");
        refuse(AssetFormat::Jpeg, b"<svg/>", "no JPEG");
        refuse(AssetFormat::Png, &png[..20], "cannot be read");
        refuse(AssetFormat::Glb, &glb(1, 12), "version 2");
        refuse(AssetFormat::Glb, &glb(2, 99), "99 bytes");
        refuse(AssetFormat::Glb, b"glTF", "version 2");
        refuse(AssetFormat::Glb, b"{}", "no binary glTF");
        refuse(AssetFormat::Ply, b"plywood", "no PLY");
        let mut bomb = png;
        bomb[16..24].copy_from_slice(&[0, 0, 0x20, 1, 0, 0, 0, 1]);
        assert!(check(AssetFormat::Png, &bomb).is_err());
    }
}
