//! Holds the house to its own rules.

#[path = "tidy/files.rs"]
mod files;
#[path = "tidy/layers.rs"]
mod layers;
#[path = "tidy/shaders.rs"]
mod shaders;
#[path = "tidy/tree.rs"]
mod tree;
