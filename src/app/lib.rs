//! Fuses many fixed surveillance cameras into one 3D scene, and answers for it over HTTP: the daemon and its commands.
//!
//! The other crates of the workspace do the work (docs/architecture.md). Rooms stand in the order in which they use each other: a room
//! uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod ending;

pub mod accuracy;

pub mod daemon;

pub mod commands;
