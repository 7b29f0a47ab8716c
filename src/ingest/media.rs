//! What a file or a folder of pictures gives before frames are numbered and timed.

use super::IngestError;
use crate::frame::YuvImage;
use std::path::Path;

/// One decoded picture with what its container says of its time.
#[derive(Debug)]
pub(super) struct Picture {
    /// The pixels.
    pub(super) image: YuvImage,
    /// Stream time in nanoseconds from the container's own zero, if it has one.
    pub(super) stream_nanos: Option<i64>,
    /// Nanoseconds to the next picture as the container promises them, if it does.
    pub(super) interval_nanos: Option<i64>,
}

/// Pictures that can be read from the first to the last, and then again.
pub(super) trait Media: Send {
    /// The path as it was asked for; for messages.
    fn path(&self) -> &Path;

    /// Goes to the first picture, also from the middle or the end.
    fn begin(&mut self) -> Result<(), IngestError>;

    /// The next picture, or `None` after the last.
    fn next_picture(&mut self) -> Result<Option<Picture>, IngestError>;
}
