//! What a file or a folder of pictures gives before frames are numbered and timed.

use super::IngestError;
use crate::media::{Decoding, EncodedFrame, Picture};
use std::path::{Path, PathBuf};

/// Pictures that can be read from the first to the last, and then again.
pub trait Medium: Send {
    /// The path as it was asked for; for messages.
    fn path(&self) -> &Path;

    /// Goes to the first picture, also from the middle or the end.
    ///
    /// # Errors
    /// When it cannot begin again.
    fn begin(&mut self) -> Result<(), IngestError>;

    /// The next of the frames that pictures are decoded from, in decoding order, as far as they were read; none where
    /// they are not kept.
    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        None
    }

    /// Encoded frames that were left out since it was opened, for want of room.
    fn n_encoded_dropped(&self) -> u64 {
        0
    }

    /// Returns the process that decodes it and what holds that; none before its first picture, and where nothing is decoded.
    fn decoding(&self) -> Option<Decoding> {
        None
    }

    /// Returns the number of pictures that were left out since it was opened, because they could not be decoded whole.
    fn n_damaged(&self) -> u64 {
        0
    }

    /// Returns the path of what holds the newest picture; for messages.
    fn newest_path(&self) -> PathBuf {
        self.path().to_path_buf()
    }

    /// The next picture, or `None` after the last.
    ///
    /// # Errors
    /// When the next picture cannot be read.
    fn next_picture(&mut self) -> Result<Option<Picture>, IngestError>;
}
