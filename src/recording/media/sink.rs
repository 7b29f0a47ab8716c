//! Ends of pipelines, where decoded pictures wait.

use super::announced::MAX_SIDE;
use super::input::Keep;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Decoded pictures that wait in the sink; decoding blocks when it is full.
const QUEUE_LENGTH: u32 = 4;

/// Makes the end of a pipeline, whose pictures lie in memory of `allocator` where there is one.
pub(super) fn make_sink(keep: Keep, allocator: Option<&gst::Allocator>) -> gst_app::AppSink {
    let caps = gst::Caps::builder("video/x-raw")
        .field("format", "I420")
        .field("width", gst::IntRange::new(1, MAX_SIDE as i32))
        .field("height", gst::IntRange::new(1, MAX_SIDE as i32))
        .build();
    let sink = gst_app::AppSink::builder()
        .caps(&caps)
        .max_buffers(if keep == Keep::All { QUEUE_LENGTH } else { 1 })
        .drop(keep == Keep::Newest)
        .sync(false)
        .enable_last_sample(false)
        .build();
    // The sink answers the decoder's question for memory itself: rows may be padded. Without that answer decoders
    // that pad copy every picture into unpadded rows.
    let allocator = allocator.cloned();
    if let Some(pad) = sink.static_pad("sink") {
        pad.add_probe(gst::PadProbeType::QUERY_DOWNSTREAM, move |_pad, info| {
            let Some(query) = info.query_mut() else { return gst::PadProbeReturn::Ok };
            let gst::QueryViewMut::Allocation(query) = query.view_mut() else {
                return gst::PadProbeReturn::Ok;
            };
            query.add_allocation_meta::<gst_video::VideoMeta>(None);
            if let Some(allocator) = &allocator {
                query.add_allocation_param(Some(allocator), gst::AllocationParams::default());
            }
            gst::PadProbeReturn::Handled
        });
    }
    sink
}

/// Has each picture's memory freed with its last user. A pool takes back what it gave, for its next pictures, as long as it
/// lives: whoever held a whole group of pictures once would leave all of their memory with a decoder that rests. What bears
/// this flag is taken for changed, and is not taken back.
pub(super) fn free_with_the_last_user(sink: &gst_app::AppSink) {
    let Some(pad) = sink.static_pad("sink") else { return };
    pad.add_probe(gst::PadProbeType::BUFFER, |_pad, info| {
        if let Some(buffer) = info.buffer_mut() {
            buffer.make_mut().set_flags(gst::BufferFlags::TAG_MEMORY);
        }
        gst::PadProbeReturn::Ok
    });
}

/// Counts the pictures that reach the sink.
pub(super) fn count_arrivals(sink: &gst_app::AppSink) -> Arc<AtomicU64> {
    let n_arrived = Arc::new(AtomicU64::new(0));
    if let Some(pad) = sink.static_pad("sink") {
        let counter = Arc::clone(&n_arrived);
        pad.add_probe(gst::PadProbeType::BUFFER, move |_pad, _info| {
            counter.fetch_add(1, Ordering::Relaxed);
            gst::PadProbeReturn::Ok
        });
    }
    n_arrived
}
