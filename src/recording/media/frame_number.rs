//! Numbers encoded frames on their way into a decoder, so that each picture is known to be of its frame.
//!
//! Times do not tell that: in AVI files frames have times in the order in which they are decoded, and in others all frames of a
//! group have one time. `GStreamer`'s base class of decoders hands on a buffer's metadata to the picture that becomes of it,
//! and so do parsers and converters. The number travels as a reference timestamp of a kind of its own.

use gst::prelude::*;
use gstreamer as gst;
use std::sync::atomic::{AtomicU64, Ordering};

const KIND: &str = "timestamp/x-videofields-frame";

/// Numbers the buffers that go through `pad`, from 0 on.
pub(super) fn number_buffers(pad: &gst::Pad) {
    let (kind, next) = (gst::Caps::new_empty_simple(KIND), AtomicU64::new(0));
    pad.add_probe(gst::PadProbeType::BUFFER, move |_pad, info| {
        if let Some(buffer) = info.buffer_mut() {
            let number = gst::ClockTime::from_nseconds(next.fetch_add(1, Ordering::Relaxed));
            gst::ReferenceTimestampMeta::add(buffer.make_mut(), &kind, number, None);
        }
        gst::PadProbeReturn::Ok
    });
}

/// Returns the number of an encoded frame, or of the frame that a picture is of; none where it has none.
pub(super) fn of(buffer: &gst::BufferRef) -> Option<u64> {
    let is_number = |meta: &gst::MetaRef<'_, gst::ReferenceTimestampMeta>| {
        meta.reference().structure(0).is_some_and(|kind| kind.name() == KIND)
    };
    buffer.iter_meta::<gst::ReferenceTimestampMeta>().find(is_number).map(|meta| meta.timestamp().nseconds())
}
