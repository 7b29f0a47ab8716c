//! Encoded frames as a stream of Matroska bytes.
//!
//! Driven by its caller's thread: each frame that goes in comes out at once as bytes to append. A header first, then
//! clusters, each begun by a key frame or after [`MAX_CLUSTER_NANOS`]; nothing is ever rewritten, so what was appended
//! before a crash is a file of its own.

use super::fault::gstreamer_fault;
use super::input::make;
use super::{EncodedFormat, EncodedFrame, Fault};
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use std::sync::{Arc, Mutex, PoisonError};

/// Unit of time in the files, nanoseconds.
pub const TICK_NANOS: i64 = 100_000;

/// A block's time is held as 16 bits beside its cluster's: at this unit 3.27 s.
const MAX_CLUSTER_NANOS: i64 = 3_000_000_000;

/// Writes one stretch of one format.
#[derive(Debug)]
pub struct Muxer {
    element: gst::Element,
    /// Feeds the element.
    source: gst::Pad,
    /// Takes what it gives; a pad that nobody holds is unlinked.
    _sink: gst::Pad,
    /// What the element gave and nobody took yet.
    output: Arc<Mutex<Vec<u8>>>,
}

impl Muxer {
    /// A muxer for frames of `format`.
    ///
    /// # Errors
    /// When `GStreamer` lacks the muxer, or Matroska cannot hold the codec as it is packaged.
    pub fn start(format: &EncodedFormat) -> Result<Self, Fault> {
        const ACTION: &str = "write Matroska";
        let element = make("matroskamux")?;
        element.set_property("streamable", true);
        element.set_property("timecodescale", TICK_NANOS);
        element.set_property("min-cluster-duration", 0_i64);
        element.set_property("max-cluster-duration", MAX_CLUSTER_NANOS);
        let output = Arc::<Mutex<Vec<u8>>>::default();
        let lacks = |what: &str| Fault::Gstreamer { action: ACTION.into(), detail: format!("no {what} pad") };
        let source = gst::Pad::builder(gst::PadDirection::Src).name("frames").build();
        let written = Arc::clone(&output);
        let sink = gst::Pad::builder(gst::PadDirection::Sink)
            .name("bytes")
            .chain_function(move |_pad, _parent, buffer| append(&written, &buffer))
            .event_function(|_pad, _parent, _event| true)
            .build();
        let fails = |error: &dyn std::error::Error| gstreamer_fault(ACTION, error);
        let into = element.request_pad_simple("video_%u").ok_or_else(|| lacks("video"))?;
        let from = element.static_pad("src").ok_or_else(|| lacks("source"))?;
        source.link(&into).map_err(|error| fails(&error))?;
        from.link(&sink).map_err(|error| fails(&error))?;
        for pad in [&source, &sink] {
            pad.set_active(true).map_err(|error| fails(&error))?;
        }
        element.set_state(gst::State::Playing).map_err(|error| fails(&error))?;
        let muxer = Self { element, source, _sink: sink, output };
        let segment = gst::FormattedSegment::<gst::ClockTime>::new();
        let is_taken = muxer.source.push_event(gst::event::StreamStart::new("frames"))
            && muxer.source.push_event(gst::event::Caps::new(format.caps()))
            && muxer.source.push_event(gst::event::Segment::new(&segment));
        if !is_taken {
            let detail = format!("{} in this packaging does not fit into it", format.codec());
            return Err(Fault::Gstreamer { action: ACTION.into(), detail });
        }
        Ok(muxer)
    }

    /// Whether Matroska holds streams of that media type, encoded.
    pub(super) fn takes(kind: &str) -> bool {
        if kind == "video/x-raw" {
            return false;
        }
        let template = gst::ElementFactory::find("matroskamux").and_then(|factory| {
            let templates = factory.static_pad_templates();
            let video = templates.iter().find(|template| template.name_template() == "video_%u");
            video.map(gst::StaticPadTemplate::caps)
        });
        template.is_some_and(|caps| caps.can_intersect(&gst::Caps::new_empty_simple(kind)))
    }

    /// Appends to `bytes` what `frame` comes to, seen `nanos` after the stretch's beginning.
    ///
    /// # Errors
    /// When the muxer refuses it; nothing more will come of this muxer then.
    pub fn push(&mut self, frame: &EncodedFrame, nanos: u64, bytes: &mut Vec<u8>) -> Result<(), Fault> {
        let mut buffer = frame.buffer().copy();
        {
            let buffer = buffer.make_mut();
            buffer.set_pts(gst::ClockTime::from_nseconds(nanos));
            buffer.set_dts(gst::ClockTime::NONE);
        }
        let pushed = self.source.push(buffer);
        bytes.append(&mut self.output.lock().unwrap_or_else(PoisonError::into_inner));
        pushed.map(|_taken| ()).map_err(|error| gstreamer_fault("write Matroska", &error))
    }
}

impl Drop for Muxer {
    fn drop(&mut self) {
        if let Err(error) = self.element.set_state(gst::State::Null) {
            tracing::warn!(%error, "a muxer did not stop");
        }
    }
}

fn append(output: &Mutex<Vec<u8>>, buffer: &gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
    let bytes = buffer.map_readable().map_err(|_unreadable: glib::BoolError| gst::FlowError::Error)?;
    output.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(&bytes);
    Ok(gst::FlowSuccess::Ok)
}
