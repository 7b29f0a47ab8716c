//! What every camera saw lately: one ring of observations a camera, bounded in bytes, and one log of events.

mod alignment;
mod event;
mod hidden;
mod horizon;
mod passed;
mod playhead;
mod replay;
mod ring;

pub use alignment::{Alignment, Sighting, align};
pub use event::{Event, EventKind, EventLog, LoggedEvent};
pub use horizon::Horizon;
pub use playhead::{Extent, MAX_RATE, Playhead, PlayheadMode};
pub use replay::{PastFrame, Replay, ReplayError};
pub(crate) use ring::{REACH_NANOS, edges};
pub use ring::{Timeline, TimelineError};

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
