//! Pictures that are recorded as JPEG, because they came unencoded or in a form that is not recorded.

use crate::media::{EncodedFrame, EncodedQueue, Picture};
use videofields_vision::encode;
use videofields_vision::frame::YuvImage;

/// Their quality, 1 to 100: what moves in one and not in the other differs by less than a camera's own noise.
const QUALITY: u8 = 90;

/// `picture` as it is recorded: as `jpeg` if it came so. None where it is too large for a JPEG.
pub(super) fn frame(picture: &Picture, jpeg: Option<Vec<u8>>) -> Option<EncodedFrame> {
    of(&picture.image, jpeg, [picture.stream_nanos, picture.interval_nanos])
}

/// A picture as it is recorded in place of what its camera sent, of which nobody may see all. None where it is too large for
/// a JPEG.
#[must_use]
pub fn recorded_as_jpeg(image: &YuvImage) -> Option<EncodedFrame> {
    of(image, None, [None, None])
}

fn of(
    image: &YuvImage,
    jpeg: Option<Vec<u8>>,
    [stream_nanos, interval_nanos]: [Option<i64>; 2],
) -> Option<EncodedFrame> {
    let bytes = jpeg.map_or_else(|| encode::jpeg_yuv(image, QUALITY), Ok);
    let bytes = bytes.inspect_err(|error| tracing::warn!(%error, "a picture is not recorded")).ok()?;
    let size_px = (image.width(), image.height());
    let frame = EncodedFrame::jpeg(bytes, size_px, stream_nanos, interval_nanos);
    frame.inspect_err(|error| tracing::warn!(%error, "a picture is not recorded")).ok()
}

/// Has `picture` recorded.
pub(super) fn push_as_jpeg(queue: &EncodedQueue, picture: &Picture) {
    if let Some(frame) = frame(picture, None) {
        queue.push(frame);
    }
}
