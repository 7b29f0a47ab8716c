//! Which cameras an answer may come from.

use crate::frame::CameraId;
use std::sync::Arc;

/// A set of cameras that an answer may come from; by default all. Cheap to clone.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Scope(Option<Arc<[CameraId]>>);

impl Scope {
    /// All cameras.
    #[must_use]
    pub const fn all() -> Self {
        Self(None)
    }

    /// These cameras alone, in any order.
    pub fn of(cameras: impl IntoIterator<Item = CameraId>) -> Self {
        let mut cameras: Vec<CameraId> = cameras.into_iter().collect();
        cameras.sort_unstable();
        cameras.dedup();
        Self(Some(cameras.into()))
    }

    /// Whether an answer may come from any camera that there is.
    #[must_use]
    pub const fn is_all(&self) -> bool {
        self.0.is_none()
    }

    /// Whether an answer may come from that camera.
    #[must_use]
    pub fn allows(&self, camera: &CameraId) -> bool {
        self.0.as_ref().is_none_or(|cameras| cameras.binary_search(camera).is_ok())
    }
}
