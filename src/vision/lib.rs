//! Learns backgrounds, finds what moves, and knows where every pixel lies in the world: arithmetic on pictures and geometry, without
//! cameras, devices, databases or networks.
//!
//! Rooms stand in the order in which they use each other: a room uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod error;

pub mod lock;

pub mod private_files;

pub mod clock;

pub mod geometry;

pub mod frame;

pub mod access;

pub mod encode;

pub mod config;

pub mod stage;

pub mod mapping;

pub mod calibrate;

pub mod background;

pub mod shake;

pub mod segment;

pub mod track;

pub mod observation;

pub mod condition;

pub mod mesh;

pub mod hull;

pub mod fields;

pub mod effects;

pub mod measures;

#[cfg(any(test, feature = "fuzzing"))]
pub mod fuzzing;
