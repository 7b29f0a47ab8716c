//! What is wrong with a camera's picture over time: frozen, covered, moved, or in another light.
//!
//! Frames with their times, the background's luma and the share of foreground flow in; conditions that begin and end
//! flow out, each with what was measured. Knows nothing of calibrations, though it is what makes them suspect, of
//! cameras' ids, or of who is told. A false alarm costs more than a few seconds of delay, so everything must last
//! before it is told.
//!
//! Inside: pictures of about 14400 cells (`look`), their edges (`edges`), the edges of the place (`reference`), where
//! they went (`search`), one verdict a look (`verdict`), and what must last (`conditions`, `frozen`, `light`).

mod conditions;
mod edges;
mod frozen;
mod light;
mod look;
mod reference;
mod search;
#[cfg(test)]
mod tests;
mod verdict;

pub use conditions::Conditions;

use crate::clock::Timestamp;
use serde::Serialize;

/// What can be wrong with a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ConditionKind {
    /// The same picture again and again, to the bit.
    Frozen,
    /// The place's edges are gone: covered, painted, fogged, blinded, out of focus.
    Covered,
    /// The place's edges stand elsewhere in the picture, or others stand there: turned or knocked.
    Moved,
    /// Most of the picture differs in brightness, and the place's edges stay: a light or an exposure switched.
    LightChanged,
}

/// What was measured when a condition was told.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// Seconds of equal pictures.
    pub still_secs: f64,
    /// Share of the place's parts with edges (blocks of the picture) in which they were found where they belong, 0
    /// to 1; 1 before the place is known.
    pub edges_left: f64,
    /// Where the place's edges stand now, less where they belong: pixels of the full picture, to the right and down.
    /// None where they were found nowhere, and for other kinds than [`ConditionKind::Moved`].
    pub displacement_px: Option<[f64; 2]>,
    /// Share of the picture that is darker or lighter than the place was, 0 to 1.
    pub changed_share: f64,
}

/// One thing that is wrong with a picture now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// What is wrong.
    pub kind: ConditionKind,
    /// The frame at which that was told; it began up to a few seconds before.
    pub since: Timestamp,
    /// What was measured, for [`ConditionKind::Moved`] at the last look, for the others when it was told.
    pub evidence: Evidence,
}

/// Whether a condition begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// From now on.
    Begun,
    /// No longer.
    Ended,
}

/// A condition that begins or ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConditionChange {
    /// The frame at which it was told.
    pub time: Timestamp,
    /// Which condition.
    pub kind: ConditionKind,
    /// Whether it begins or ends.
    pub phase: Phase,
    /// What was measured at `time`.
    pub evidence: Evidence,
}
