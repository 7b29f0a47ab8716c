//! What can be said of a scene whose truth nobody knows.

use serde::{Deserialize, Serialize};

/// Every camera's figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Unjudged {
    /// In the scene's order.
    pub cameras: Vec<UnjudgedCamera>,
}

/// One camera's figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnjudgedCamera {
    /// Its id.
    pub id: String,
    /// Its background against what the other cameras' give at its place; `None` where it could not be drawn.
    pub left_out: Option<LeftOut>,
    /// Frames held back from learning against the background learned without them.
    pub held_back: Option<HeldBack>,
}

/// A camera's background against the others'.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Share of its picture whose surface another camera sees, 0 to 1.
    pub seen_share: f64,
    /// Over that part, 8-bit codes; `None` where there is no such part.
    pub rmse: Option<f64>,
    /// Over that part, decibels.
    pub psnr_db: Option<f64>,
    /// Over that part.
    pub ssim: Option<f64>,
}

/// Frames against a background that never learned them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldBack {
    /// Frames held back.
    pub n_frames: u64,
    /// Mean difference of luma between frame and background over the pixels that were called background, 8-bit codes.
    pub mean_difference_codes: Option<f64>,
    /// Share of the pixels that hardly changed from the frame before and to the frame after, and were called moving all
    /// the same. Who stands still is rightly among them: an upper bound.
    pub false_share: Option<f64>,
}
