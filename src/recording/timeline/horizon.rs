//! How far cameras had been seen at a moment: whoever looks at an instant within it finds the same later, whatever came since.

use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// The newest observation that each camera had at some moment. Cheap to clone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Horizon(Arc<[(CameraId, Timestamp)]>);

impl Horizon {
    /// Of cameras that had seen something, the time of the newest of it.
    #[must_use]
    pub fn new(newest: impl IntoIterator<Item = (CameraId, Timestamp)>) -> Self {
        Self(newest.into_iter().collect())
    }

    /// The newest that a camera had seen; none where that was nothing.
    #[must_use]
    pub fn of(&self, camera: &CameraId) -> Option<Timestamp> {
        self.0.iter().find(|(id, _)| id == camera).map(|(_, newest)| *newest)
    }
}
