//! The segment that is being written: frames in, bytes of its file out, and what its row may say of it.

use super::ArchiveError;
use super::folder::Folder;
use super::matroska::{Block, Walker};
use super::name::SegmentName;
use super::scan::Progress;
use crate::media::{EncodedFormat, EncodedFrame, Muxer, TICK_NANOS};
use crate::store::{SegmentRecord, SegmentState};
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// One file that is being written.
#[derive(Debug)]
pub(super) struct OpenSegment {
    file: File,
    path: PathBuf,
    format: Arc<EncodedFormat>,
    muxer: Muxer,
    walker: Walker,
    /// What is in the file.
    written: Progress,
    /// What is known to be on the disk.
    record: SegmentRecord,
    scratch: Vec<u8>,
    blocks: Vec<Block>,
    /// When it was made safe last, by the clock that never steps.
    pub synced_at: Duration,
}

impl OpenSegment {
    /// Makes the file of a segment that begins with `frame`, at `now` by the machine's clock; none where there is such a file.
    pub(super) fn begin(
        folder: &Folder,
        name: &SegmentName,
        frame: &EncodedFrame,
        now: Timestamp,
    ) -> Result<Option<Self>, ArchiveError> {
        // First, because it leaves nothing behind when it fails.
        let muxer = Muxer::start(&frame.format).map_err(|fault| ArchiveError::unwritable(&fault))?;
        let path = folder.path().join(name.to_string());
        let file = match folder.create(name) {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => return Ok(None),
            other => other.map_err(ArchiveError::files("make", &path))?,
        };
        let record = SegmentRecord {
            id: 0,
            camera: name.camera.clone(),
            path: name.to_string(),
            first_at: name.first_at,
            last_at: name.first_at,
            written_at: now,
            n_frames: 0,
            n_bytes: 0,
            header_bytes: 0,
            codec: frame.format.codec().to_owned(),
            size_px: frame.format.size_px().unwrap_or_default(),
            state: SegmentState::Open,
            keys: Vec::new(),
        };
        Ok(Some(Self {
            file,
            path,
            format: Arc::clone(&frame.format),
            muxer,
            walker: Walker::new(),
            written: Progress::default(),
            record,
            scratch: Vec::new(),
            blocks: Vec::new(),
            synced_at: Duration::ZERO,
        }))
    }

    /// Whether a frame of that format can go on in it.
    pub(super) fn fits(&self, format: &Arc<EncodedFormat>) -> bool {
        Arc::ptr_eq(&self.format, format) || self.format == *format
    }

    /// Writes a frame; the bytes that it took.
    pub(super) fn append(&mut self, frame: &EncodedFrame, at: Timestamp) -> Result<u64, ArchiveError> {
        debug_assert_eq!(at.as_nanos() % TICK_NANOS, 0, "scene times of recorded cameras are whole ticks");
        let nanos = u64::try_from(at.nanos_since(self.record.first_at)).unwrap_or(0);
        self.scratch.clear();
        self.muxer.push(frame, nanos, &mut self.scratch).map_err(|fault| ArchiveError::unwritable(&fault))?;
        self.blocks.clear();
        let blocks = &mut self.blocks;
        let walked = self.walker.feed(&self.scratch, &mut |block| blocks.push(block));
        if walked.is_err() || blocks.is_empty() {
            // Not with any muxer seen; what cannot be read again is not recorded.
            let detail = "the muxer wrote what cannot be read".to_owned();
            return Err(ArchiveError::Unwritable { detail });
        }
        self.file.write_all(&self.scratch).map_err(ArchiveError::files("write", &self.path))?;
        self.blocks.iter().for_each(|block| self.written.meet(*block));
        Ok(self.scratch.len() as u64)
    }

    /// Whether there is more than is known to be on the disk.
    pub(super) const fn is_ahead(&self) -> bool {
        self.written.n_bytes > self.record.n_bytes
    }

    /// Waits until all that was written is on the disk; what the row may say then.
    pub(super) fn sync(&mut self) -> Result<&SegmentRecord, ArchiveError> {
        if self.is_ahead() {
            self.file.sync_data().map_err(ArchiveError::files("write", &self.path))?;
            self.record.header_bytes = self.walker.header_bytes().unwrap_or(0);
            self.written.write_to(&mut self.record);
        }
        Ok(&self.record)
    }

    /// The row of the segment when nothing more comes: what is on the disk.
    pub(super) fn into_closed(mut self) -> SegmentRecord {
        self.record.state = SegmentState::Closed;
        self.record
    }

    /// The file's name.
    pub(super) fn name(&self) -> SegmentName {
        SegmentName { camera: self.record.camera.clone(), first_at: self.record.first_at }
    }

    /// Whether its file has not one whole frame.
    pub(super) const fn is_empty(&self) -> bool {
        self.written.n_frames == 0
    }

    /// Bytes that were written, whether they are on the disk or not.
    pub(super) const fn written_bytes(&self) -> u64 {
        self.written.n_bytes
    }
}
