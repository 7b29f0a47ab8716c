//! All that touches `GStreamer`: inputs become pictures and, where asked, the encoded frames that they were decoded from.
//!
//! In: an [`Input`]. Out: [`Picture`]s in the decoder's own planes, [`EncodedFrame`]s in decoding order, both with the
//! stream's own times, and a [`Fault`] where the stream ends other than by its end. Knows no camera, no scene time, no
//! file's place.

mod allowed;
mod announced;
mod client;
mod clip;
mod decoder;
mod demuxer;
mod device;
mod encoded;
mod fault;
mod frame_number;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;
mod http;
mod input;
mod jpeg;
mod linking;
mod login;
mod losses;
mod muxer;
mod pipeline;
mod planes;
mod plugins;
mod probes;
mod rtsp;
mod sink;
mod tap;
mod tls;
mod unfinished;
mod worker;

pub use announced::{MAX_SIDE, is_too_large};
pub use client::Peer;
pub(crate) use client::{ANSWER_TIME, USER_AGENT, connect, expect_success};
pub use clip::{ClipContainer, ClipWriter};
pub use decoder::{Decoder, look_at_sandbox};
pub use demuxer::Demuxer;
pub use device::DeviceWish;
pub use encoded::{EncodedFormat, EncodedFrame, EncodedQueue};
pub use fault::{ConnectionFault, Fault, SIZE_LIMIT};
pub use input::{Input, descriptor_path};
pub use login::Login;
pub(crate) use login::{Answering, OwnedLogin};
pub use muxer::{Muxer, TICK_NANOS};
use planes::PlaneReader;
pub use planes::Times;
pub use plugins::{Codec, decoded_codecs, missing_elements};
pub use worker::{Decoding, Sandbox, run_if_asked};

use videofields_vision::frame::YuvImage;

#[cfg(test)]
mod tests;

/// One decoded picture with what its container says of its time.
#[derive(Debug)]
pub struct Picture {
    /// The pixels.
    pub image: YuvImage,
    /// Stream time in nanoseconds from the container's own zero, if it has one.
    pub stream_nanos: Option<i64>,
    /// Nanoseconds to the next picture as the container promises them, if it does.
    pub interval_nanos: Option<i64>,
    /// When it was taken as its camera says, nanoseconds since 1970 (UTC), where the stream says it. RTSP cameras do in
    /// sender reports, the first of which comes some seconds after the first frame.
    pub reference_nanos: Option<i64>,
    /// Number of the encoded frame from which it was decoded, where that is known ([`EncodedFrame::number`]).
    pub encoded_number: Option<u64>,
}
