//! Everything that is known of one camera's frame: the picture, what moves in it, what is followed, and its background.

mod hidden;

use crate::frame::{Frame, Mask, YuvImage};
use crate::segment::Blob;
use crate::track::Track;
use std::sync::Arc;

/// One frame with all that was learned from it. Cheap to clone: everything large is shared.
#[derive(Clone, Debug)]
pub struct Observation {
    /// The picture.
    pub frame: Frame,
    /// Soft foreground mask of the frame's size.
    pub soft_mask: Arc<Mask>,
    /// Hard mask of the frame's size: 255 moving, 50 shadow, 0 background.
    pub labels: Arc<Mask>,
    /// Background picture of that time, of the frame's size (may be a little older than the frame: it is shared between
    /// frames).
    pub background: Arc<YuvImage>,
    /// Connected pieces of the hard mask.
    pub blobs: Arc<[Blob]>,
    /// What is followed, in growing order of ids.
    pub tracks: Arc<[Track]>,
}
