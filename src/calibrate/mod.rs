//! Calibrations in and out: the project's plain JSON, and importers of other people's formats.

mod json;

pub use json::{CameraDocument, DistortionDocument};
