//! To be furnished.

mod pipeline;

pub use pipeline::Pipeline;
