//! Bodies: what moves, as it stands at an instant, made of shapes.
//!
//! Owns a body's bounds and place; how bodies come about is `actor`'s.

use super::shape::Part;
use glam::{DVec2, DVec3};

/// A body at an instant; one that is not there has no parts and bounds without extent.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) parts: Vec<Part>,
    /// The tightest box along the world's axes.
    pub(super) bounds: (DVec3, DVec3),
    /// Where it stands: the ground below its middle.
    pub(super) foot: DVec3,
    /// Unit vector of the direction of travel.
    pub(super) heading: DVec2,
}

impl Body {
    /// The body of these parts.
    pub(super) fn of(parts: Vec<Part>, foot: DVec3, heading: DVec2) -> Self {
        let bounds = parts
            .iter()
            .map(|part| part.shape.bounds())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (part_low, part_high)| {
                (low.min(part_low), high.max(part_high))
            });
        let bounds = if parts.is_empty() { (foot, foot) } else { bounds };
        Self { parts, bounds, foot, heading }
    }

    /// A body that is not there.
    pub(super) fn absent() -> Self {
        Self::of(Vec::new(), DVec3::ZERO, DVec2::X)
    }

    /// Whether it is there.
    pub(super) const fn is_present(&self) -> bool {
        !self.parts.is_empty()
    }
}
