//! What routes about the daemon itself have in common.

use super::openapi::Tag;

/// What they are about.
pub(super) const TAG: Tag = ("System", "The daemon itself");
