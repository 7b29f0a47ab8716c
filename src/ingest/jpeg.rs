//! Pictures that are recorded as JPEG, because they came unencoded or in a form that is not recorded.

use crate::encode;
use crate::media::{EncodedFrame, EncodedQueue, Picture};

/// Their quality, 1 to 100: what moves in one and not in the other differs by less than a camera's own noise.
const QUALITY: u8 = 90;

/// `picture` as it is recorded: as `jpeg` if it came so. None where it is too large for a JPEG.
pub(super) fn frame(picture: &Picture, jpeg: Option<Vec<u8>>) -> Option<EncodedFrame> {
    let image = &picture.image;
    let bytes = jpeg.map_or_else(|| encode::jpeg_yuv(image, QUALITY), Ok);
    let bytes = bytes.inspect_err(|error| tracing::warn!(%error, "a picture is not recorded")).ok()?;
    let size_px = (image.width(), image.height());
    Some(EncodedFrame::jpeg(bytes, size_px, picture.stream_nanos, picture.interval_nanos))
}

/// Has `picture` recorded.
pub(super) fn push_as_jpeg(queue: &EncodedQueue, picture: &Picture) {
    if let Some(frame) = frame(picture, None) {
        queue.push(frame);
    }
}
