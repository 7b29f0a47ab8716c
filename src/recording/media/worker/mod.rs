//! Decoding in processes of their own, which hold no key, no password and no connection.
//!
//! Libraries in C decode what comes from outside. Each stream is decoded by one worker: a process of the same program
//! ([`run_if_asked`]) that gets encoded frames, a file or a file's bytes over one socket, and gives planes back in memory
//! that the daemon made. Before it reads anything it gives up what it does not need ([`Sandbox`]): other files, the network,
//! memory beyond limits, most system calls. Its death ends its stream and nothing else.

mod allocator;
mod channel;
mod format;
mod group;
mod handle;
mod launch;
mod link;
mod memory;
mod message;
mod pictures;
mod sandbox;
mod serve;
#[cfg(test)]
mod trial;

pub use launch::run_if_asked;
#[cfg(test)]
mod tests;

#[cfg(any(test, feature = "fuzzing"))]
pub use handle::fuzzing::{worker_channel, worker_messages};
pub(super) use handle::{Work, WorkerHandle};
pub use sandbox::{Decoding, Sandbox};
