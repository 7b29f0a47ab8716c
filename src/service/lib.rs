//! Runs cameras, scenes and the renderer, and answers for them: the daemon without HTTP.
//!
//! Rooms stand in the order in which they use each other: a room uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod sequence;

pub mod wall;

pub mod engine;

pub mod catalog;

pub mod evidence;
