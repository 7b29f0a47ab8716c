//! Knows scenes, what stands in them at one instant, and plans pictures of them: which passes a picture needs, why, and how exactly.
//!
//! Rooms stand in the order in which they use each other: a room uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod scene;

pub mod occupancy;

pub mod fuse;

pub mod plan;

#[cfg(any(test, feature = "fuzzing"))]
pub mod fuzzing;
