//! The graphics device: headless wgpu on Vulkan, shader composition, growing buffers, readback and timing.
//!
//! In: descriptors and bytes; out: pictures, durations and typed errors (a wgpu error never panics). Must not know
//! what is drawn: no word of scenes, cameras or views.

mod buffer;
mod copying;
mod device;
mod mirror;
mod readback;
mod shader;
mod tally;
mod timing;

pub use buffer::GrowingBuffer;
pub use device::{Gpu, GpuError};
pub(crate) use mirror::mirror;
pub use mirror::{Mirror, MirrorField};
pub use readback::Readback;
pub(crate) use readback::read;
pub use shader::{SHADERS, compose};
pub use tally::{Count, Counted, TextureDescriptor};
pub use timing::{PassTime, Span, Timer};
