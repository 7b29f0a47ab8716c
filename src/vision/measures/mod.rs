//! Measures how far pictures, masks and distances lie from what is true.
//!
//! In: what was made and what it should have been. Out: figures. Knows nothing of who made what it judges.

mod comparison;
mod exposure;
mod figures;
mod quantile;
mod similarity;
mod steadiness;

pub use comparison::{AccuracyError, Comparison, compare};
pub use exposure::exposed_like;
pub use figures::{
    MaskScore, Mean, NO_OWNER, Pooled, SeamEnergy, add_flicker, dilated, distance_figures, silhouette,
};
pub use quantile::quantile;
pub use steadiness::Steadiness;
