//! Takes recorded frames out of their container as their camera encoded them; nothing is decoded.

use super::fault::gstreamer_fault;
use super::input::make;
use super::{EncodedFormat, EncodedFrame, Fault, Input, Times};
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::sync::Arc;

/// Frames that wait to be taken; reading blocks when there are as many.
const QUEUE_LENGTH: u32 = 64;

/// How long one look for a frame lasts, and how many there are before an input counts as stuck.
const LOOK: gst::ClockTime = gst::ClockTime::from_mseconds(50);
const MAX_LOOKS: u32 = 200;

/// The frames of one Matroska stream, in decoding order.
#[derive(Debug)]
pub struct Demuxer {
    pipeline: gst::Pipeline,
    bus: gst::Bus,
    sink: gst_app::AppSink,
    /// That of the newest frame; all frames of one share it.
    format: Option<Arc<EncodedFormat>>,
    /// The file that it reads, kept open.
    _file: Option<std::fs::File>,
}

impl Demuxer {
    /// Starts to read `input`.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element or cannot start; all else shows with the first frame.
    pub fn start(input: Input) -> Result<Self, Fault> {
        const ACTION: &str = "read Matroska";
        let demux = make("matroskademux")?;
        let sink = gst_app::AppSink::builder()
            .max_buffers(QUEUE_LENGTH)
            .sync(false)
            .enable_last_sample(false)
            .build();
        let pipeline = gst::Pipeline::new();
        let fault = |error: &dyn std::error::Error| gstreamer_fault(ACTION, error);
        pipeline.add(&demux).map_err(|error| fault(&error))?;
        pipeline.add(&sink).map_err(|error| fault(&error))?;
        let file = input.into_source()?.link(&pipeline, &demux)?;
        let weak_sink = sink.downgrade();
        demux.connect_pad_added(move |_demux, pad| {
            let target = weak_sink.upgrade().and_then(|sink| sink.static_pad("sink"));
            // Our files hold one stream; of others the first that comes counts.
            let Some(target) = target.filter(|target| !target.is_linked()) else { return };
            if let Err(error) = pad.link(&target) {
                tracing::warn!(%error, "a recorded stream is not linked");
            }
        });
        let bus = pipeline.bus().ok_or_else(|| Fault::Gstreamer {
            action: ACTION.into(),
            detail: "the pipeline has no bus".to_owned(),
        })?;
        let demuxer = Self { pipeline, bus, sink, format: None, _file: file };
        demuxer.pipeline.set_state(gst::State::Playing).map_err(|error| fault(&error))?;
        Ok(demuxer)
    }

    /// The next frame; none at the end, or where nothing came and it no longer `goes_on`. Times count from the file's zero
    /// ([`Times::Written`]).
    ///
    /// # Errors
    /// When the stream breaks off in a way that is no end.
    pub fn frame(&mut self, goes_on: &dyn Fn() -> bool) -> Result<Option<EncodedFrame>, Fault> {
        for _ in 0..MAX_LOOKS {
            if let Some(sample) = self.sink.try_pull_sample(LOOK) {
                let Some(caps) = sample.caps_owned() else { continue };
                let known = self.format.take().filter(|known| *known.caps() == caps);
                let known = self.format.insert(known.unwrap_or_else(|| Arc::new(EncodedFormat::new(caps))));
                match EncodedFrame::of(&sample, Arc::clone(known), Times::Written) {
                    Some(frame) => return Ok(Some(frame)),
                    None => continue,
                }
            }
            if self.sink.is_eos() || !goes_on() {
                return Ok(None);
            }
            if let Some(message) = self.bus.pop_filtered(&[gst::MessageType::Error])
                && let gst::MessageView::Error(error) = message.view()
            {
                let error: glib::Error = error.error();
                return Err(Fault::Damaged(error.message().trim_end_matches('.').to_owned()));
            }
        }
        Err(Fault::Damaged("its reader gives nothing".to_owned()))
    }
}

impl Drop for Demuxer {
    fn drop(&mut self) {
        if let Err(error) = self.pipeline.set_state(gst::State::Null) {
            tracing::warn!(%error, "a reader did not stop");
        }
    }
}
