//! Takes cameras' streams, keeps what is learned of them in memory and in SQLite, and records them.
//!
//! Rooms stand in the order in which they use each other: a room uses only rooms above it in this list (`tests/tidy.rs` fails otherwise).

pub mod memory;

pub mod priority;

pub mod signing;

pub mod telemetry;

pub mod media;

pub mod store;

pub mod accounts;

pub mod share;

pub mod archive;

pub mod timeline;

pub mod ingest;

pub mod onvif;

#[cfg(any(test, feature = "fuzzing"))]
pub mod fuzzing;

/// Makes workers of test programs: they are started as the daemon is.
#[cfg(test)]
#[ctor::ctor(unsafe)]
fn run_worker_if_asked() {
    media::run_if_asked();
}
