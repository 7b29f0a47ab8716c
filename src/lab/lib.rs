//! Measures and simulates for the developers of videofields: judges what the daemon's crates make against simulated worlds.
//!
//! Rooms stand in the order in which they use each other: a room uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod made_scenes;

pub mod worlds;

pub mod entities;

pub mod unjudged;

pub mod live;

pub mod report;

pub mod world_sequence;

pub mod bench;

pub mod gpu_report;

pub mod drawn;

pub mod commands;
