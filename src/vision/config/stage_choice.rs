//! Says of a stage of detection whether it runs: always, never, or where a camera's pictures call for it.

use serde::{Deserialize, Serialize};

/// Choice of when a stage of detection runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StageChoice {
    /// Runs where the camera's pictures call for it.
    #[default]
    Auto,
    /// Runs always.
    On,
    /// Never runs.
    Off,
}

impl StageChoice {
    /// Returns its name in settings.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
        }
    }
}
