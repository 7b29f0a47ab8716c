//! Parts what an HTTP camera sends into JPEG pictures.
//!
//! Cameras write multipart loosely: no boundary before the first part, another type than image/jpeg or none, lengths that are
//! wrong or left out. What begins with FF D8 is a picture here, whatever stands around it, and it ends where its own markers
//! say (ITU-T T.81, B.1).

/// Most bytes of a picture.
const MAX_PICTURE_BYTES: usize = 16 << 20;

/// Parts a stream of bytes.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    bytes: Vec<u8>,
    /// Bytes before this place were given out or dropped.
    begins: usize,
    /// The place in the picture that is looked at next; none where no picture has begun.
    looking: Option<(usize, Place)>,
    /// Bytes that were no picture since the last one.
    n_between: usize,
}

/// Bytes among which a place in a picture lies.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// A marker stands there.
    Marker,
    /// Coded data goes on there.
    Data,
    /// Neither is there: the next picture is looked for.
    Lost,
}

/// Result of looking at a picture.
enum Found {
    /// The picture ends there, or the next one begins there before it has ended.
    End(usize),
    /// More bytes are needed to tell what begins there.
    More(usize, Place),
}

impl Splitter {
    /// Adds bytes that came.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.begins);
        self.begins = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// Returns the bytes that came since the last picture and belong to none.
    pub(super) const fn n_between(&self) -> usize {
        self.n_between
    }

    /// Returns true while a picture has begun and not ended.
    pub(super) const fn is_within(&self) -> bool {
        self.looking.is_some()
    }

    /// Returns the next picture, whole or as far as it came before the next one began.
    pub(super) fn next(&mut self) -> Option<Vec<u8>> {
        if self.looking.is_none() {
            self.skip_to_beginning();
        }
        let rest = &self.bytes[self.begins..];
        let (at, place) = self.looking?;
        match look(rest, at, place) {
            Found::End(n_bytes) => Some(self.take(n_bytes)),
            Found::More(at, place) if rest.len() <= MAX_PICTURE_BYTES => {
                self.looking = Some((at, place));
                None
            }
            // One that never ends is cut, and so no picture.
            Found::More(..) => Some(self.take(MAX_PICTURE_BYTES)),
        }
    }

    fn take(&mut self, n_bytes: usize) -> Vec<u8> {
        let picture = self.bytes[self.begins..self.begins + n_bytes].to_vec();
        self.begins += n_bytes;
        self.looking = None;
        self.n_between = 0;
        picture
    }

    /// Drops what stands before the next beginning of a picture.
    fn skip_to_beginning(&mut self) {
        let rest = &self.bytes[self.begins..];
        let begins = rest.windows(3).position(|bytes| bytes == [0xff, 0xd8, 0xff]);
        // The last two bytes may be a beginning of which the rest has not come.
        let n_bytes = begins.unwrap_or_else(|| rest.len().saturating_sub(2));
        self.n_between += n_bytes;
        self.begins += n_bytes;
        self.looking = begins.map(|_| (2, Place::Marker));
    }
}

/// Goes from marker to marker of the picture at the beginning of `bytes`, from a place on. Each byte is looked at once, but for
/// some at the end.
fn look(bytes: &[u8], mut at: usize, mut place: Place) -> Found {
    loop {
        match place {
            Place::Data => {
                let is_marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 0xd0..=0xd7 | 0xff);
                let next = bytes[at..].windows(2).position(is_marker);
                let Some(next) = next else {
                    return Found::More(bytes.len().saturating_sub(1).max(at), place);
                };
                (at, place) = (at + next, Place::Marker);
            }
            Place::Lost => {
                let next = bytes[at..].windows(3).position(|bytes| bytes == [0xff, 0xd8, 0xff]);
                let more = || Found::More(bytes.len().saturating_sub(2).max(at), place);
                return next.map_or_else(more, |next| Found::End(at + next));
            }
            Place::Marker => {
                let Some(marker) = bytes.get(at..at + 2) else { return Found::More(at, place) };
                match marker {
                    [0xff, 0xd9] => return Found::End(at + 2),
                    // Another picture.
                    [0xff, 0xd8] => return Found::End(at),
                    // Fill bytes, and markers without a segment.
                    [0xff, 0xff] => at += 1,
                    [0xff, 0x01 | 0xd0..=0xd7] => at += 2,
                    [0xff, kind] => {
                        let next = behind_segment(bytes, at).filter(|next| *next <= bytes.len());
                        let Some(next) = next else { return Found::More(at, place) };
                        place = if *kind == 0xda { Place::Data } else { Place::Marker };
                        at = next;
                    }
                    _ => place = Place::Lost,
                }
            }
        }
    }
}

/// Returns the end of the segment whose marker stands at `at`.
fn behind_segment(bytes: &[u8], at: usize) -> Option<usize> {
    let length = bytes.get(at + 2..at + 4)?;
    Some(at + 2 + usize::from(u16::from_be_bytes([length[0], length[1]])).max(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(level: u8, is_commented: Option<&[u8]>) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture =
            image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([level, (x * y) as u8, (x ^ y) as u8]));
        picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
        let mut bytes = bytes.into_inner();
        if let Some(comment) = is_commented {
            let segment = [&[0xff, 0xfe][..], &(comment.len() as u16 + 2).to_be_bytes(), comment].concat();
            bytes.splice(2..2, segment);
        }
        bytes
    }

    fn parts(chunks: &[&[u8]]) -> Vec<Vec<u8>> {
        let mut splitter = Splitter::default();
        let mut found = Vec::new();
        for chunk in chunks {
            splitter.push(chunk);
            found.extend(std::iter::from_fn(|| splitter.next()));
        }
        found
    }

    #[test]
    fn pictures_are_found_whatever_stands_around_them() {
        let pictures = [picture(10, None), picture(20, None), picture(30, None)];
        for (before, after) in [
            ("--b\r\nContent-Type: image/jpeg\r\nContent-Length: 9\r\n\r\n", "\r\n"),
            ("Content-Type: image/jpg\n\n", "\n--b\n"),
            ("--b\r\n\r\n", ""),
            ("", ""),
            ("\u{0}\u{7f}", "ÿØ"),
        ] {
            let all: Vec<u8> = pictures
                .iter()
                .flat_map(|picture| [before.as_bytes(), picture, after.as_bytes()].concat())
                .collect();
            assert_eq!(parts(&[&all]), pictures, "{before:?}");
            for n in [1, 2, 3, 7, 1000] {
                let chunks: Vec<&[u8]> = all.chunks(n).collect();
                assert_eq!(parts(&chunks), pictures, "{n} bytes at a time");
            }
        }
    }

    #[test]
    fn a_picture_within_a_picture_is_no_picture_of_its_own() {
        let thumbnail = picture(1, None);
        let whole = picture(2, Some(&thumbnail));
        assert_eq!(parts(&[&whole, &whole]), [whole.clone(), whole]);
    }

    #[test]
    fn what_is_cut_short_costs_itself_alone() {
        let whole = picture(9, None);
        for n in [3, 10, 25, 300, whole.len() / 2, whole.len() - 1] {
            let all = [&whole[..n], b"\r\n--b\r\n\r\n", &whole, &whole, &whole].concat();
            let found = parts(&[&all]);
            let n_whole = found.iter().filter(|part| **part == whole).count();
            // The next picture may lie in its last segment, if that says that it goes on.
            assert!(n_whole >= 2 && found.last() == Some(&whole), "{n} bytes: {n_whole} of 3");
        }
    }

    #[test]
    fn bytes_of_a_picture_that_comes_in_pieces_are_looked_at_once() {
        // A thousand pieces of a kilobyte: looked at from the beginning each time, half a billion bytes.
        let mut splitter = Splitter::default();
        splitter.push(&[0xff, 0xd8, 0xff, 0xda, 0, 2]);
        for n in 1..=1000_usize {
            splitter.push(&[7; 1000]);
            assert_eq!(splitter.next(), None);
            assert!(
                matches!(splitter.looking, Some((at, Place::Data)) if at == 1000 * n + 5),
                "{:?}",
                splitter.looking
            );
        }
        splitter.push(&[0xff, 0xd9]);
        assert_eq!(splitter.next().map(|bytes| bytes.len()), Some(1_000_008));
    }

    #[test]
    fn what_holds_no_picture_is_counted_and_not_kept() {
        let mut splitter = Splitter::default();
        for _ in 0..100 {
            splitter.push(&[0xff; 1000]);
            assert_eq!(splitter.next(), None);
        }
        assert!(splitter.bytes.len() - splitter.begins < 10 && splitter.n_between() > 99_000);
        let mut splitter = Splitter::default();
        splitter.push(&[&[0xff, 0xd8, 0xff, 0xda, 0, 2][..], &vec![7; MAX_PICTURE_BYTES]].concat());
        assert_eq!(splitter.next().map(|bytes| bytes.len()), Some(MAX_PICTURE_BYTES));
    }
}
