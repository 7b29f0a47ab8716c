//! Threads, tasks and channels: cameras on one side, the renderer on the other. [`Handle`] is the only door that
//! `api` uses.

mod error;
mod handle;

pub use error::EngineError;
pub use handle::{
    At, CameraSummary, Door, Handle, LocateMethod, Located, Readiness, SceneSummary, SourceTime, ViewAnswer,
    ViewRequest,
};
