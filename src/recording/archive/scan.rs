//! What a segment's bytes hold: counted while they are written, and counted again from the file.

use super::keys::Key;
use super::matroska::{Block, Header, Walker};
use crate::store::{SegmentRecord, SegmentState};
use std::fs::File;
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::sync::atomic::{AtomicBool, Ordering};
use videofields_vision::clock::Timestamp;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 256 * 1024;

/// What the whole blocks of a segment come to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Progress {
    /// Frames.
    pub n_frames: u64,
    /// The byte behind the last.
    pub n_bytes: u64,
    /// The latest time, nanoseconds from the first frame.
    pub newest_nanos: i64,
    /// Where decoding can begin.
    pub keys: Vec<Key>,
}

impl Progress {
    /// Counts a block, unless it was counted.
    pub(super) fn meet(&mut self, block: Block) {
        if block.end <= self.n_bytes {
            return;
        }
        self.n_frames += 1;
        self.n_bytes = block.end;
        self.newest_nanos = self.newest_nanos.max(block.nanos);
        if block.is_key && block.leads_cluster {
            self.keys.push(Key { offset: block.cluster_offset, nanos: block.nanos });
        }
    }

    /// What a row says.
    pub(super) fn of(record: &SegmentRecord) -> Option<Self> {
        Some(Self {
            n_frames: record.n_frames,
            n_bytes: record.n_bytes,
            newest_nanos: record.last_at.nanos_since(record.first_at),
            keys: super::keys::decode(&record.keys)?,
        })
    }

    /// Makes a row say it.
    pub(super) fn write_to(&self, record: &mut SegmentRecord) {
        record.n_frames = self.n_frames;
        record.n_bytes = self.n_bytes;
        record.last_at = record.first_at.saturating_add_nanos(self.newest_nanos);
        record.keys = super::keys::encode(&self.keys);
    }
}

/// Why a file was not read to its end.
#[derive(Debug)]
pub(super) enum ScanError {
    Io(io::Error),
    /// It was asked to stop.
    Stopped,
}

impl From<io::Error> for ScanError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// The row of a file that has none; none where the file has not one whole frame.
pub(super) fn adopt(
    name: &super::name::SegmentName,
    file: &File,
    stop: &AtomicBool,
) -> Result<Option<SegmentRecord>, ScanError> {
    let mut progress = Progress::default();
    let walker = walk(file, Walker::new(), 0, (&mut progress, stop))?;
    let (Some(header_bytes), false) = (walker.header_bytes(), progress.keys.is_empty()) else {
        return Ok(None);
    };
    let Header { codec, size_px } = walker.header();
    let mut record = SegmentRecord {
        id: 0,
        camera: name.camera.clone(),
        path: name.to_string(),
        first_at: name.first_at,
        last_at: name.first_at,
        written_at: written_last(file)?,
        n_frames: 0,
        n_bytes: 0,
        header_bytes,
        codec: media_type(codec).to_owned(),
        size_px: *size_px,
        state: SegmentState::Closed,
        keys: Vec::new(),
    };
    progress.write_to(&mut record);
    Ok(Some(record))
}

/// Returns when a file was written last, by the machine's clock then.
fn written_last(file: &File) -> io::Result<Timestamp> {
    let metadata = file.metadata()?;
    Ok(Timestamp::from_nanos(
        metadata.mtime().saturating_mul(1_000_000_000).saturating_add(metadata.mtime_nsec()),
    ))
}

/// Reads on behind what a row says, from its last key frame on, and makes it say the whole blocks of the file; from
/// the file's beginning where the two do not fit. False where the file has not one whole frame.
pub(super) fn read_on(record: &mut SegmentRecord, file: &File, stop: &AtomicBool) -> Result<bool, ScanError> {
    let len = file.metadata()?.len();
    if let Some(mut progress) = Progress::of(record)
        && let Some(last) = progress.keys.last().copied()
        && record.n_bytes <= len
    {
        let walker = walk(file, Walker::at_cluster(last.offset), last.offset, (&mut progress, stop))?;
        if walker.whole_bytes() >= record.n_bytes {
            progress.write_to(record);
            return Ok(true);
        }
    }
    let mut progress = Progress::default();
    let walker = walk(file, Walker::new(), 0, (&mut progress, stop))?;
    let Some(header_bytes) = walker.header_bytes().filter(|_| !progress.keys.is_empty()) else {
        return Ok(false);
    };
    record.header_bytes = header_bytes;
    progress.write_to(record);
    Ok(true)
}

/// Walks from `offset` to the end, or to what cannot be read.
fn walk(
    file: &File,
    mut walker: Walker,
    mut offset: u64,
    (progress, stop): (&mut Progress, &AtomicBool),
) -> Result<Walker, ScanError> {
    let mut chunk = vec![0; CHUNK_BYTES];
    loop {
        if stop.load(Ordering::Relaxed) {
            return Err(ScanError::Stopped);
        }
        let n_bytes = match file.read_at(&mut chunk, offset) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            read => read?,
        };
        // A torn end is how a crash leaves a file: what was whole counts.
        if n_bytes == 0 || walker.feed(&chunk[..n_bytes], &mut |block| progress.meet(block)).is_err() {
            return Ok(walker);
        }
        offset += n_bytes as u64;
    }
}

/// A codec's media type by its name in Matroska.
fn media_type(codec: &str) -> &str {
    match codec {
        "V_MPEG4/ISO/AVC" => "video/x-h264",
        "V_MPEGH/ISO/HEVC" => "video/x-h265",
        "V_MJPEG" => "image/jpeg",
        "V_VP8" => "video/x-vp8",
        "V_VP9" => "video/x-vp9",
        "V_AV1" => "video/x-av1",
        other => other,
    }
}

/// The instant that a time in a segment stands for.
pub(super) const fn instant(record: &SegmentRecord, nanos: i64) -> Timestamp {
    record.first_at.saturating_add_nanos(nanos)
}

#[cfg(test)]
mod tests {
    use super::super::matroska::tests::{cluster, header};
    use super::*;
    use std::io::Write;

    static GO: AtomicBool = AtomicBool::new(false);

    fn adopted(bytes: &[u8]) -> Option<SegmentRecord> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        let name = "north/2026-11-22/050607.000000000Z.mkv".parse().unwrap();
        adopt(&name, &file, &GO).unwrap()
    }

    #[test]
    fn a_file_is_adopted_up_to_its_last_whole_block_wherever_it_breaks_off() {
        let bytes = [header(), cluster(0), cluster(10_000)].concat();
        let whole = adopted(&bytes).unwrap();
        assert_eq!((whole.n_frames, whole.n_bytes, whole.size_px), (6, bytes.len() as u64, (160, 120)));
        assert_eq!((whole.codec.as_str(), whole.header_bytes), ("image/jpeg", header().len() as u64));
        assert_eq!(whole.last_at.nanos_since(whole.first_at), 1_040_000_000);
        assert_eq!(super::super::keys::decode(&whole.keys).unwrap().len(), 2);
        for end in 0..bytes.len() {
            let torn = adopted(&bytes[..end]);
            assert!(torn.as_ref().is_none_or(|torn| torn.n_bytes <= end as u64 && torn.n_frames > 0));
            assert_eq!(torn.is_none(), end < header().len() + 5 + 13 + 9 + 704, "{end}");
        }
        assert_eq!(adopted(b"RIFF....AVI "), None);
    }

    #[test]
    fn a_row_is_read_on_from_its_last_key_frame() {
        let bytes = [header(), cluster(0), cluster(10_000)].concat();
        let expected = adopted(&bytes).unwrap();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        for end in 0..bytes.len() {
            let Some(mut record) = adopted(&bytes[..end]) else { continue };
            // Another file each time, and so written at another.
            record.written_at = expected.written_at;
            assert!(read_on(&mut record, &file, &GO).unwrap());
            assert_eq!(record, expected, "{end}");
        }
        // The file lost what the row says it has.
        let mut record = expected.clone();
        file.set_len(bytes.len() as u64 - 1).unwrap();
        assert!(read_on(&mut record, &file, &GO).unwrap());
        assert_eq!((record.n_frames, record.n_bytes < expected.n_bytes), (5, true));
        file.set_len(header().len() as u64).unwrap();
        assert!(!read_on(&mut record, &file, &GO).unwrap());
        assert!(matches!(read_on(&mut record, &file, &AtomicBool::new(true)), Err(ScanError::Stopped)));
    }
}
