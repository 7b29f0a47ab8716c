//! What can be wrong with a configuration, and where.

use crate::error::{ErrorKind, Fault};
use std::fmt;
use std::path::PathBuf;

/// Why there is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read at all.
    #[error("cannot read the configuration: {source}: {}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What stands there is no file.
    #[error("the configuration must be a TOML file, but this is {what}: {}", path.display())]
    NotAFile {
        /// Where.
        path: PathBuf,
        /// What it is instead.
        what: &'static str,
    },
    /// The file is too large to be a configuration.
    #[error("the configuration may have at most {} bytes: {}", super::MAX_FILE_BYTES, path.display())]
    TooLarge {
        /// Which file.
        path: PathBuf,
    },
    /// The file was read, and these are its faults; never empty.
    #[error("{}", lines(.0))]
    Faults(Vec<ConfigFault>),
}

impl ConfigError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Unreadable { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                ErrorKind::NotFound
            }
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::Unreadable { .. } | Self::NotAFile { .. } | Self::Faults(_) => ErrorKind::Invalid,
        }
    }

    /// The faults, one each; empty when the file could not be read.
    #[must_use]
    pub fn faults(&self) -> &[ConfigFault] {
        if let Self::Faults(faults) = self { faults } else { &[] }
    }
}

fn lines(faults: &[ConfigFault]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// One fault of a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigFault {
    /// Where the value was written.
    pub origin: Origin,
    /// Dotted path of the value, such as `camera[0].source.path`; empty for the whole.
    pub path: String,
    /// What is wrong and what is allowed.
    pub message: String,
}

/// Where a value was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// In the file.
    File {
        /// As it was named to [`super::load`].
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
    },
    /// In an environment variable.
    Environment {
        /// Its name.
        variable: String,
    },
    /// Nowhere: the settings were made by a program.
    Program,
}

impl ConfigFault {
    /// The fault of settings that come from no file.
    pub(super) fn of_settings(fault: &Fault) -> Self {
        Self { origin: Origin::Program, path: dotted(&fault.place), message: fault.message.clone() }
    }
}

impl fmt::Display for ConfigFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.origin {
            Origin::File { file, line, column } => {
                write!(formatter, "{}:{line}:{column}: ", file.display())?;
            }
            Origin::Environment { variable } => write!(formatter, "environment variable {variable}: ")?,
            Origin::Program => {}
        }
        if !self.path.is_empty() {
            write!(formatter, "{}: ", self.path)?;
        }
        formatter.write_str(&self.message)
    }
}

/// A JSON pointer as people write paths in TOML: `/camera/0/id` is `camera[0].id`.
pub(super) fn dotted(pointer: &str) -> String {
    let mut path = String::new();
    for key in pointer.split('/').skip(1) {
        if !path.is_empty() && key.bytes().all(|byte| byte.is_ascii_digit()) && !key.is_empty() {
            path.push_str(&format!("[{key}]"));
            continue;
        }
        if !path.is_empty() {
            path.push('.');
        }
        path.push_str(&key.replace("~1", "/").replace("~0", "~").escape_debug().to_string());
    }
    path
}
