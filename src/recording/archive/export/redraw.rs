//! Pictures that stand in an export in the place of those that were recorded, since nobody may see these as they are.

use crate::media::EncodedFrame;
use serde_json::Value;
use std::fmt;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;

/// Draws one camera's recorded pictures anew.
pub trait Redraw: Send + Sync {
    /// The picture that is shown first after an instant and before `to`, as it may be given out, and its scene time; each can
    /// be decoded by itself. None after the last. Blocks for as long as decoding takes.
    ///
    /// # Errors
    /// With the reason, where it cannot be drawn: then nothing of this export may be given out.
    fn next_after(
        &self,
        after: Timestamp,
        to: Timestamp,
    ) -> Result<Option<(EncodedFrame, Timestamp)>, String>;

    /// What the manifest says of it, once all was drawn.
    fn told(&self) -> Value;
}

/// Who draws a camera's pictures anew.
#[derive(Clone)]
pub struct Redrawing(pub Arc<dyn Redraw>);

impl fmt::Debug for Redrawing {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Redrawing")
    }
}

impl PartialEq for Redrawing {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
