//! What moves in a world: walkers, cyclists, cars.
//!
//! ```text
//! path (where) ─▶ motion (when) ─▶ gait (steps) ─▶ walker ─┐
//!                       ├──────────────────────▶ cyclist ─┼─▶ Body (shapes with colours)
//!                       └──────────────────────▶ car ─────┘
//! ```
//!
//! A body is an exact function of time and of the ground below it; nothing is integrated, so any instant can be asked
//! for first. Knows nothing of pictures.

mod car;
mod cyclist;
mod gait;
mod limbs;
mod motion;
mod path;
mod walker;

pub(super) use car::{Car, CarStyle};
pub(super) use cyclist::Cyclist;
pub(super) use motion::{Ending, Motion, MotionFault, Pace, Posture, Stop, WorldTime};
pub(super) use path::{Path, PathPoint};
pub(super) use walker::{Clothes, Walker};

use super::figure::Body;
use glam::DVec2;

/// Height of the ground at a place, metres.
pub(super) type GroundHeight<'a> = &'a dyn Fn(DVec2) -> f64;

/// What an actor is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorKind {
    /// A person on foot.
    Walker,
    /// A person on a bicycle, and the bicycle.
    Cyclist,
    /// A car or van.
    Car,
}

impl ActorKind {
    /// Its name in documents.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Walker => "walker",
            Self::Cyclist => "cyclist",
            Self::Car => "car",
        }
    }
}

/// Something that moves.
#[derive(Clone, Debug)]
pub(super) struct Actor {
    pub(super) id: String,
    pub(super) part: Role,
}

/// What an actor plays.
#[derive(Clone, Debug)]
pub(super) enum Role {
    Walker(Walker),
    Cyclist(Cyclist),
    Car(Car),
}

impl Actor {
    /// The body at an instant; absent where the actor is not there.
    pub(super) fn body(&self, time: WorldTime, ground: GroundHeight<'_>) -> Body {
        match &self.part {
            Role::Walker(walker) => walker.body(time, ground),
            Role::Cyclist(cyclist) => cyclist.body(time, ground),
            Role::Car(car) => car.body(time, ground),
        }
        .unwrap_or_else(Body::absent)
    }

    pub(super) const fn kind(&self) -> ActorKind {
        match self.part {
            Role::Walker(_) => ActorKind::Walker,
            Role::Cyclist(_) => ActorKind::Cyclist,
            Role::Car(_) => ActorKind::Car,
        }
    }
}
