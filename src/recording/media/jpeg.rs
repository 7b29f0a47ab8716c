//! Whether bytes are a whole JPEG picture, so that a live stream's broken ones never reach a decoder: it would end the
//! stream on some, and paint grey what is missing of others. The size that a picture announces is read here too.

use super::announced::{Announced, Size};

/// Whether `bytes` are a JPEG picture from its beginning to its end, with one or three components. What the picture's
/// own data hold is not looked at. Cameras put zeros and line ends behind the end.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | b'\r' | b'\n'));
    let bytes = end.map_or(&[][..], |end| &bytes[..=end]);
    bytes.starts_with(&[0xff, 0xd8]) && bytes.ends_with(&[0xff, 0xd9]) && has_frame(&bytes[2..])
}

/// Returns the size that the first picture in `bytes` announces; where none begins there, none is announced.
pub(super) fn announced(bytes: &[u8]) -> Announced {
    let Some(begins) = bytes.windows(3).position(|bytes| bytes == [0xff, 0xd8, 0xff]) else {
        return Announced::Nothing;
    };
    frame(&bytes[begins + 2..]).map_or(Announced::Unreadable, |(size, _n_components)| Announced::Size(size))
}

/// Returns whether a frame header that can be decoded comes before the first scan.
fn has_frame(rest: &[u8]) -> bool {
    frame(rest).is_some_and(|(size, n_components)| size != (0, 0) && matches!(n_components, 1 | 3))
}

/// Returns columns and rows of the one frame header before the first scan, and the number of its components. Where there are two,
/// decoders might take either.
fn frame(mut rest: &[u8]) -> Option<(Size, u8)> {
    let mut found = None;
    loop {
        // Any number of these may stand before a marker, and some markers stand alone.
        match rest {
            [0xff, 0xff, ..] => {
                rest = &rest[1..];
                continue;
            }
            [0xff, 0x01 | 0xd0..=0xd8, ..] => {
                rest = &rest[2..];
                continue;
            }
            // Bytes that are lost between segments: decoders go on to the next marker.
            [0xff, 0, ..] | [0..=0xfe, ..] if found.is_some() => {
                rest = &rest[1..];
                continue;
            }
            _ => {}
        }
        let [0xff, marker, high, low, body @ ..] = rest else { return found };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        match *marker {
            0xd9 | 0xda => return found,
            _ if found.is_some() && is_frame_header(&[0xff, *marker]) => return None,
            _ if is_frame_header(&[0xff, *marker]) => {
                let [_precision, h0, h1, w0, w1, n_components, ..] = body else { return None };
                let side = |high, low| u32::from(u16::from_be_bytes([high, low]));
                found = Some(((side(*w0, *w1), side(*h0, *h1)), *n_components));
            }
            _ => {}
        }
        let Some(next) = length.checked_sub(2).and_then(|length| body.get(length..)) else {
            // A segment that ends behind the picture. Decoders that go on to the next marker would find another header.
            return found.filter(|_| !body.windows(2).any(is_frame_header));
        };
        rest = next;
    }
}

/// Returns true for the marker of a frame header (ITU-T T.81, table B.1): the others among them are of tables.
const fn is_frame_header(marker: &[u8]) -> bool {
    matches!(marker, [0xff, 0xc0..=0xcf]) && !matches!(marker, [0xff, 0xc4 | 0xc8 | 0xcc])
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
        // Markers that stand alone have no length.
        let alone = [&whole[..2], &[0xff, 0x01, 0xff, 0xd3], &whole[2..]].concat();
        assert_eq!(announced(&alone), Announced::Size((40, 30)));
        assert_eq!(announced(&[b"--b\r\n\r\n", &whole[..]].concat()), Announced::Size((40, 30)));
        assert_eq!(announced(&whole[..start]), Announced::Unreadable);
        assert_eq!(announced(&whole[2..]), Announced::Nothing);
        // A second frame header, of which decoders might take either, and an end before the first.
        let second =
            [&whole[..start], &[0xff, 0xc3, 0, 11, 8, 0, 9, 0, 9, 1, 1, 0x11, 0], &whole[start..]].concat();
        assert_eq!((announced(&second), is_whole(&second)), (Announced::Unreadable, false));
        let behind = [
            &whole[..start],
            &[0xff, 0xc3, 0, 11, 8, 0, 9, 0, 9, 1, 1, 0x11, 0, 7, 0xff, 0],
            &whole[start..],
        ]
        .concat();
        assert_eq!(
            (announced(&behind), is_whole(&behind)),
            (Announced::Unreadable, false),
            "behind bytes that are lost"
        );
        let beyond = [
            &whole[..start],
            &[0xff, 0xc3, 0, 11, 8, 0, 9, 0, 9, 1, 1, 0x11, 0, 0xff, 0xfc, 0xff, 0xff],
            &whole[start..],
        ]
        .concat();
        assert_eq!(
            (announced(&beyond), is_whole(&beyond)),
            (Announced::Unreadable, false),
            "within a segment beyond the end"
        );
        let ended = [&whole[..2], &[0xff, 0xd9, 0, 4, 0, 0], &whole[2..]].concat();
        assert_eq!((announced(&ended), is_whole(&ended)), (Announced::Unreadable, false));
        let scan = whole.windows(2).position(|pair| pair == [0xff, 0xda]).unwrap();
        assert_eq!(announced(&whole[..scan - 3]), Announced::Size((40, 30)), "cut behind its frame header");
        let mut four = whole;
        four[start + 9] = 4;
        assert!(!is_whole(&four));
    }
}
