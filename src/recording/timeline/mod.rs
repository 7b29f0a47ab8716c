//! What every camera saw lately: one ring of observations a camera, bounded in bytes, and one log of events.

mod alignment;
mod event;
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
pub use ring::{REACH_NANOS, edges};
pub use ring::{Timeline, TimelineError};
