//! Truths about messages of what moves, whatever bytes come.

use super::{
    ForegroundHeader, ForegroundMessage, ForegroundPart, MAX_PIXELS, RECTANGLE_BYTES, begun, read_foreground,
    run_lengths, write_part,
};

/// Most pixels that are written once more: what costs time shows nothing else.
const MAX_WRITTEN_PIXELS: usize = 1 << 20;

/// Takes a message apart: no more rectangles than it has bytes for, within the picture, with no more pixels together than a camera has, and
/// what was read is read again where it is written.
pub fn foreground_messages(data: &[u8]) -> usize {
    match read_foreground(data) {
        None => 0,
        Some(ForegroundMessage::Background(header, jpeg)) => {
            assert!(jpeg.len() <= data.len());
            let written = begun(&header, 1, 0, jpeg);
            assert_eq!(read_foreground(&written), Some(ForegroundMessage::Background(header, jpeg)));
            1
        }
        Some(ForegroundMessage::Foreground(header, parts)) => {
            holds_parts(&header, &parts, data.len());
            let n_pixels: usize = parts.iter().map(|part| part.mask.len()).sum();
            assert!(n_pixels <= MAX_PIXELS, "{n_pixels} pixels in {} bytes", data.len());
            if n_pixels <= MAX_WRITTEN_PIXELS {
                let written = written(&header, &parts);
                let n_parts = parts.len();
                let read = read_foreground(&written);
                assert_eq!(read, Some(ForegroundMessage::Foreground(header, parts)));
                return 1 + n_parts;
            }
            1 + parts.len()
        }
    }
}

fn holds_parts(header: &ForegroundHeader, parts: &[ForegroundPart<'_>], n_bytes: usize) {
    assert!(parts.len() * RECTANGLE_BYTES <= n_bytes, "{} rectangles", parts.len());
    let jpegs: usize = parts.iter().map(|part| part.jpeg.len()).sum();
    assert!(jpegs <= n_bytes, "no byte is read twice");
    for part in parts {
        let [x, y, width, height] = part.of.rect;
        let [columns, rows] = header.size_px.map(u32::from);
        assert!(x + width <= columns && y + height <= rows, "{:?} in {columns} x {rows}", part.of);
        assert_eq!(part.mask.len(), width as usize * height as usize);
        assert_ne!(part.of.track, Some(0));
    }
}

fn written(header: &ForegroundHeader, parts: &[ForegroundPart<'_>]) -> Vec<u8> {
    let mut body = Vec::new();
    for part in parts {
        write_part(&mut body, &part.of, &run_lengths(part.mask.iter().copied()), part.jpeg);
    }
    begun(header, 2, parts.len() as u32, &body)
}
