//! From blobs to tracks: what one camera sees, linked over time.
//!
//! Blobs of one camera's frames flow in, in order of time; tracks with ids that outlive a frame flow out. Knows
//! nothing of pixels' colours, of the world, or of other cameras.
//!
//! The parts, one file each: rectangles with real edges (`extent`), how a place moves (`motion`), what a blob says of
//! a place (`sighting`), one tracked thing (`target`), who gets which blob (`assign`), people who touch (`group`),
//! their order (`tracker`), and where a thing went, thinned out (`thinned`) and in few bytes (`foot_path`).

mod assign;
mod extent;
mod foot_path;
mod group;
mod motion;
mod sighting;
mod target;
#[cfg(test)]
mod tests;
mod thinned;
mod tracker;

pub use assign::{Pair, assign};
pub use foot_path::{Foot, FootPath, PathError, PathPoint};
pub use thinned::{MAX_PATH_POINTS, PathPlace, ThinnedPath, TimedPlace, push_number, take_number};
pub use tracker::{MAX_TRACKS, Tracker};

use crate::clock::Timestamp;
use crate::segment::PixelRect;

/// One thing that one camera follows, at one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Its number: the same from frame to frame, never given to another thing by the same [`Tracker`].
    pub id: u64,
    /// Where it is: as large as the thing itself, not as what happens to show of it, cut by the picture's border;
    /// never empty.
    pub rect: PixelRect,
    /// Index of the frame's blob that shows it, the largest if several do; `None` where it is predicted only.
    pub blob_idx: Option<u32>,
    /// Middle of its lower edge, pixels with pixel centres at +0.5; outside the picture where the border cuts it.
    pub foot_in_image: [f64; 2],
    /// How fast its centre moves, pixels a second.
    pub velocity_px_per_sec: [f64; 2],
    /// Time of the first frame that showed it.
    pub first_seen: Timestamp,
    /// Time of the latest frame that showed it.
    pub last_seen: Timestamp,
    /// Whether others share its blob, so that its place is partly a guess.
    pub is_in_group: bool,
    /// Since when its centre has stayed within a small share of its own size; `None` while it moves.
    pub still_since: Option<Timestamp>,
}
