//! Holds the house to its own rules.

#[path = "tidy/shaders.rs"]
mod shaders;
