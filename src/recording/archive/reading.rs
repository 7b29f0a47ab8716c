//! The bytes from which the frames of an instant are decoded.

use super::folder::Folder;
use super::{ArchiveError, keys, scan};
use crate::store::{SegmentRecord, SegmentState};
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use videofields_vision::clock::Timestamp;

/// A segment from a key frame on: its header, then its clusters from that key frame's to the end of what was
/// written when it was opened. Times as they are written (`media::Times::Written`) count from the segment's first frame,
/// wherever the reading begins. Pictures of before [`Self::starts_at`] may come and cannot be decoded: they build on what was
/// before the key frame.
#[derive(Debug)]
pub struct Reading {
    segment: SegmentRecord,
    starts_at: Timestamp,
    file: File,
    /// Where the key frame's cluster begins.
    from: u64,
    /// Where the bytes end that were there when it was opened.
    end: u64,
    /// Bytes of header and clusters that were read.
    n_read: u64,
}

impl Reading {
    /// Opens the file of a segment for decoding what is seen at `at`.
    pub(super) fn open(folder: &Folder, segment: SegmentRecord, at: Timestamp) -> Result<Self, ArchiveError> {
        let unusable = |what| ArchiveError::UnusableRow { what, path: segment.path.clone() };
        let name = segment.path.parse().map_err(|_foreign: super::name::NotASegment| unusable("its name"))?;
        let keys = keys::decode(&segment.keys).ok_or_else(|| unusable("its index"))?;
        let key = keys::before(&keys, segment.first_at, at).ok_or_else(|| unusable("it has no key frame"))?;
        if key.offset < segment.header_bytes || key.offset > segment.n_bytes {
            return Err(unusable("its index"));
        }
        let path = folder.path().join(&segment.path);
        let file = folder.open(&name).map_err(ArchiveError::files("read", &path))?;
        // Of a segment that is being written, what is not on the disk yet can be read all the same; its last block may
        // be cut, which costs its decoder that block.
        let end = match segment.state {
            SegmentState::Open => file.metadata().map_err(ArchiveError::files("read", &path))?.len(),
            _ => segment.n_bytes,
        };
        let end = end.max(segment.n_bytes);
        let starts_at = scan::instant(&segment, key.nanos);
        Ok(Self { segment, starts_at, file, from: key.offset, end, n_read: 0 })
    }

    /// The segment.
    #[must_use]
    pub const fn segment(&self) -> &SegmentRecord {
        &self.segment
    }

    /// Scene time of the key frame with which the frames begin.
    #[must_use]
    pub const fn starts_at(&self) -> Timestamp {
        self.starts_at
    }

    /// The instant that a time in the file stands for.
    #[must_use]
    pub const fn instant(&self, written_nanos: i64) -> Timestamp {
        scan::instant(&self.segment, written_nanos)
    }

    /// Scene time of the newest frame on the disk.
    #[must_use]
    pub const fn last_at(&self) -> Timestamp {
        self.segment.last_at
    }
}

impl Read for Reading {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let header_bytes = self.segment.header_bytes;
        let (offset, end) = if self.n_read < header_bytes {
            (self.n_read, header_bytes)
        } else {
            (self.from + (self.n_read - header_bytes), self.end)
        };
        let most = usize::try_from(end.saturating_sub(offset)).unwrap_or(usize::MAX).min(buffer.len());
        let n_bytes = self.file.read_at(&mut buffer[..most], offset)?;
        self.n_read += n_bytes as u64;
        Ok(n_bytes)
    }
}
