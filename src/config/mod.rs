//! TOML -> validated, immutable settings; every fault with file, line, column and path.

mod settings;

pub use settings::*;
