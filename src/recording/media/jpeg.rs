//! Whether bytes are a whole JPEG picture, so that a live stream's broken ones never reach a decoder: it would end the
//! stream on some, and paint grey what is missing of others.

/// Whether `bytes` are a JPEG picture from its beginning to its end, with one or three components. What the picture's
/// own data hold is not looked at. Cameras put zeros and line ends behind the end.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | b'\r' | b'\n'));
    let bytes = end.map_or(&[][..], |end| &bytes[..=end]);
    bytes.starts_with(&[0xff, 0xd8]) && bytes.ends_with(&[0xff, 0xd9]) && has_frame(&bytes[2..])
}

/// Whether a frame header comes before the first scan.
fn has_frame(mut rest: &[u8]) -> bool {
    let mut has_frame = false;
    loop {
        let [0xff, marker, high, low, body @ ..] = rest else { return false };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        match *marker {
            // Any number of these may stand before a marker.
            0xff => {
                rest = &rest[1..];
                continue;
            }
            0xda => return has_frame,
            0xc0..=0xcf if !matches!(*marker, 0xc4 | 0xc8 | 0xcc) => {
                // Precision, rows, columns, components.
                let [_, _, _, _, _, n_components, ..] = body else { return false };
                has_frame = body[1..5] != [0; 4] && matches!(n_components, 1 | 3);
            }
            _ => {}
        }
        let Some(next) = length.checked_sub(2).and_then(|length| body.get(length..)) else { return false };
        rest = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(40, 30, |x, y| image::Rgb([x as u8, y as u8, 90]));
        picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn whole_pictures_are_told_from_cut_and_foreign_ones() {
        let whole = picture();
        assert!(is_whole(&whole));
        assert!(is_whole(&[&whole[..], b"\r\n\0\0\0"].concat()));
        for n in 0..whole.len() {
            assert!(!is_whole(&whole[..n]), "{n} of {} bytes", whole.len());
        }
        for bytes in [&b""[..], b"\0\0", b"no picture", &[0xff, 0xd8, 0xff, 0xd9]] {
            assert!(!is_whole(bytes), "{bytes:?}");
        }
        let start = whole.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
        let mut four = whole;
        four[start + 9] = 4;
        assert!(!is_whole(&four));
    }
}
