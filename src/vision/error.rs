//! What a caller can do about a failure.
//!
//! Every room has its own `thiserror` enum with a `kind()`; this file owns the kinds and the one shape in which
//! faults of a document (configuration, scene, request) name their place. It knows nothing of HTTP: `api` alone
//! maps a kind to a status. `gather` reads such documents and finds all their faults, `wording` says them.

mod gather;
mod wording;

pub use gather::{Fields, Gatherer, MAX_FAULTS, pointer_to};
pub use wording::{closest, one_of, unknown};

use std::fmt;

/// What a caller can do about a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// The request or document is wrong; it must be changed before it can succeed.
    Invalid,
    /// What was asked for does not exist (a camera, a scene, a frame at that time).
    NotFound,
    /// It is not known who the caller is: a log-in or token is needed.
    Unauthenticated,
    /// The caller may not do that.
    Forbidden,
    /// What was to be changed is another than the caller knew: look again, then ask again.
    Changed,
    /// It does not go with what there is; something else must be changed first.
    Conflict,
    /// The caller tried too often; trying later may succeed.
    Throttled,
    /// Something is asked for that this build, machine or codec set cannot do.
    Unsupported,
    /// A documented limit would be passed; ask for less.
    TooLarge,
    /// The disk has no room for it: making room helps, and nothing else.
    StorageFull,
    /// Not now: starting, stopping, overloaded, a camera without its first frame. Trying later may succeed.
    Unavailable,
    /// A fault of the daemon or its machine; the caller can do nothing about it.
    Internal,
}

/// One fault of a document and its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// JSON pointer (RFC 6901) into the document, or the name of a query parameter.
    pub place: String,
    /// What is wrong and what is allowed; lower case, no full stop.
    pub message: String,
}

impl Fault {
    /// A fault at `place`.
    pub fn new(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { place: place.into(), message: message.into() }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = if self.place.is_empty() { "(document)" } else { self.place.as_str() };
        write!(formatter, "{place}: {}", self.message)
    }
}

/// Joins faults into one line for a log or a terminal.
#[must_use]
pub fn join_faults(faults: &[Fault]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}
