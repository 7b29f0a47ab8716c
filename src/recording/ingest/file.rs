//! Video files, in any container and codec that `GStreamer` knows.
//!
//! One pass through the file is one pipeline; the next pass of a loop builds a new one on the same open file,
//! because seeking back depends on an index that many surveillance files lack. What is read is the file that was
//! opened beneath the media roots, whatever became of its path since.

use super::jpeg::push_as_jpeg;
use super::medium::Medium;
use super::{IngestError, MediaRoots, StopFlag, Tap};
use crate::media::{Decoder, Decoding, EncodedFrame, EncodedQueue, Fault, Input, Picture, descriptor_path};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// How long a file may give nothing before it counts as failed, seconds.
const SILENCE_SECS: u64 = 10;

/// Bytes of encoded frames that wait for being taken.
pub(super) const ENCODED_BYTES: usize = 16 << 20;

/// How long one look for a frame lasts; the stop flag is heeded between looks.
const LOOK: Duration = Duration::from_millis(100);

/// A video file.
pub struct VideoFile {
    path: PathBuf,
    file: File,
    stop: StopFlag,
    /// Takes the encoded frames, where they are wanted.
    encoded: Option<Arc<EncodedQueue>>,
    pass: Option<Decoder>,
    /// Pictures of passes before this one that could not be decoded whole.
    n_damaged: u64,
}

impl VideoFile {
    /// Opens the file at `path`; whether it is a video shows with its first picture.
    ///
    /// # Errors
    /// When the file lies outside the roots, cannot be read, or is no video.
    pub fn open(path: &Path, roots: &MediaRoots, stop: &StopFlag, tap: Tap) -> Result<Self, IngestError> {
        let file = roots.open(path)?;
        let encoded = (tap == Tap::Open).then(|| Arc::new(EncodedQueue::new(ENCODED_BYTES)));
        Ok(Self { path: path.to_path_buf(), file, stop: stop.clone(), encoded, pass: None, n_damaged: 0 })
    }

    /// What its pictures are encoded in, and how many nanoseconds it has, as far as that is known with its first picture.
    pub(super) fn told(&self) -> (Option<String>, Option<i64>) {
        let decoder = self.pass.as_ref();
        (decoder.and_then(Decoder::codec), decoder.and_then(Decoder::duration_nanos))
    }

    /// Goes on at a time, or before it; where it stands in a file that cannot be sought in.
    pub fn seek(&mut self, stream_nanos: i64) {
        if let Some(decoder) = &mut self.pass {
            decoder.seek(stream_nanos);
        }
    }

    fn error(&self, fault: Fault) -> IngestError {
        IngestError::of_fault(&self.path, fault)
    }

    /// Returns the next picture; none at the end.
    fn pull(&self, decoder: &mut Decoder) -> Result<Option<Picture>, IngestError> {
        for _ in 0..SILENCE_SECS * 1000 / LOOK.as_millis() as u64 {
            if self.stop.is_raised() {
                return Err(IngestError::Stopped);
            }
            if let Some(picture) = decoder.pull(LOOK) {
                return Ok(Some(picture));
            }
            if let Some(fault) = decoder.fault() {
                return Err(self.error(fault));
            }
            if decoder.has_ended() {
                return Ok(None);
            }
        }
        Err(IngestError::Silent { path: self.path.clone(), secs: SILENCE_SECS })
    }

    /// Ends a pass and keeps what it counted.
    fn end_pass(&mut self, decoder: &Decoder) {
        self.n_damaged += decoder.n_damaged();
    }
}

impl Medium for VideoFile {
    fn path(&self) -> &Path {
        &self.path
    }

    fn begin(&mut self) -> Result<(), IngestError> {
        if let Some(decoder) = self.pass.take() {
            self.end_pass(&decoder);
        }
        let input = Input::file(&descriptor_path(&self.file)).map_err(|fault| self.error(fault))?;
        let decoder = Decoder::start(input, self.encoded.as_ref()).map_err(|fault| self.error(fault))?;
        self.pass = Some(decoder);
        Ok(())
    }

    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        self.encoded.as_ref()?.take()
    }

    fn n_damaged(&self) -> u64 {
        self.n_damaged + self.pass.as_ref().map_or(0, Decoder::n_damaged)
    }

    fn n_encoded_dropped(&self) -> u64 {
        self.encoded.as_ref().map_or(0, |encoded| encoded.n_dropped())
    }

    fn decoding(&self) -> Option<Decoding> {
        self.pass.as_ref()?.decoding()
    }

    fn next_picture(&mut self) -> Result<Option<Picture>, IngestError> {
        let Some(mut decoder) = self.pass.take() else { return Ok(None) };
        let picture = match self.pull(&mut decoder) {
            Ok(Some(picture)) => picture,
            over => {
                self.end_pass(&decoder);
                return over.map(|_none| None);
            }
        };
        self.pass = Some(decoder);
        if let Some(queue) = self.encoded.as_ref().filter(|queue| queue.wants_pictures()) {
            push_as_jpeg(queue, &picture);
        }
        Ok(Some(picture))
    }
}
