//! Truths about the pictures of an HTTP camera, whatever it sends.

use super::pictures::Splitter;
use crate::media::announced::Announced;
use crate::media::fuzzing::{decoded_size, pieces};
use crate::media::jpeg;

/// Finds pictures: the same however the bytes are cut, in the order in which they came, and of whole ones the size that a decoder reads.
///
/// The first byte says how the others are cut.
pub fn http_pictures(data: &[u8]) -> usize {
    let [seed, bytes @ ..] = data else { return 0 };
    let found = parts([bytes]);
    assert_eq!(parts(pieces(*seed, bytes)), found, "cut in pieces");
    assert_eq!(parts(bytes.chunks(1)), found, "a byte at a time");
    let mut rest = bytes;
    for picture in &found.0 {
        assert!(picture.starts_with(&[0xff, 0xd8]));
        let begins = rest.windows(picture.len()).position(|bytes| bytes == picture);
        rest = &rest[begins.expect("a picture is what came") + picture.len()..];
        holds_whole(picture);
    }
    holds_whole(bytes);
    found.0.len()
}

/// Returns the pictures in bytes that come in pieces, and the number of bytes since the last one.
fn parts<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> (Vec<Vec<u8>>, usize) {
    let mut splitter = Splitter::default();
    let mut found = Vec::new();
    for piece in pieces {
        splitter.push(piece);
        found.extend(std::iter::from_fn(|| splitter.next()));
    }
    (found, splitter.n_between())
}

fn holds_whole(bytes: &[u8]) {
    let said = jpeg::announced(bytes);
    if !jpeg::is_whole(bytes) {
        return;
    }
    let Announced::Size(size) = said else { panic!("a whole picture announces {said:?}") };
    if let Some(decoded) = decoded_size(bytes, image::ImageFormat::Jpeg) {
        assert_eq!(size, decoded, "as a decoder has it");
    }
}
