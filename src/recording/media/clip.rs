//! Encoded frames as a file for people to keep: with an index, so that any player seeks in it.
//!
//! H.264 and H.265 go into MP4, which everything plays; the decoding times that MP4 wants, and that many cameras do not
//! give, are worked out by `GStreamer`'s timestampers. All other codecs go into Matroska. Times are kept to 0.1 ms.

use super::fault::gstreamer_fault;
use super::input::make;
use super::{EncodedFormat, EncodedFrame, Fault, TICK_NANOS};
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::collections::VecDeque;
use std::fs::File;
use std::os::fd::AsRawFd;

const ACTION: &str = "write a clip";

/// Bytes that wait to be written; pushing waits when there are as many.
const QUEUE_BYTES: u64 = 8 << 20;

/// Between two looks at what is waited for.
const LOOK: gst::ClockTime = gst::ClockTime::from_mseconds(20);

/// Frames among which the one beside a frame is sought: codecs put a few out of order.
const REORDERED: usize = 4;

/// Looks for the index of a clip to be written, once all its frames are: a minute.
const MAX_FINISH_LOOKS: u32 = 3000;

/// Ticks of a second: 0.1 ms.
const TICKS_PER_SEC: u32 = (1_000_000_000 / TICK_NANOS) as u32;

/// What kind of file a clip is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipContainer {
    /// ISO base media.
    Mp4,
    /// Matroska.
    Matroska,
}

impl ClipContainer {
    /// What frames of `format` go into.
    #[must_use]
    pub fn of(format: &EncodedFormat) -> Self {
        match format.codec() {
            "video/x-h264" | "video/x-h265" => Self::Mp4,
            _ => Self::Matroska,
        }
    }

    /// The ending of its files' names, without a dot.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Mp4 => "mp4",
            Self::Matroska => "mkv",
        }
    }

    /// Its media type.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Mp4 => "video/mp4",
            Self::Matroska => "video/x-matroska",
        }
    }
}

/// Writes one clip of one format.
#[derive(Debug)]
pub struct ClipWriter {
    pipeline: gst::Pipeline,
    bus: gst::Bus,
    source: gst_app::AppSrc,
    /// Times of the newest frames.
    recent_nanos: VecDeque<u64>,
    /// Written through its descriptor: open for as long as the pipeline lives.
    _file: File,
}

impl ClipWriter {
    /// Begins a clip of frames of `format` in the empty `file`.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element or cannot start.
    pub fn start(format: &EncodedFormat, file: File) -> Result<Self, Fault> {
        let fault = |error: &dyn std::error::Error| gstreamer_fault(ACTION, error);
        let lacks = |what: &str| Fault::Gstreamer { action: ACTION.into(), detail: format!("no {what}") };
        let timestamper = match format.codec() {
            "video/x-h264" => Some(make("h264timestamper")?),
            "video/x-h265" => Some(make("h265timestamper")?),
            _ => None,
        };
        let mux = match ClipContainer::of(format) {
            ClipContainer::Mp4 => {
                let mux = make("mp4mux")?;
                mux.set_property("movie-timescale", TICKS_PER_SEC);
                mux.set_property("trak-timescale", TICKS_PER_SEC);
                mux
            }
            ClipContainer::Matroska => {
                let mux = make("matroskamux")?;
                mux.set_property("timecodescale", TICK_NANOS);
                mux
            }
        };
        let element = make("appsrc")?;
        let source = element.clone().downcast::<gst_app::AppSrc>().map_err(|_other| lacks("appsrc"))?;
        source.set_caps(Some(format.caps()));
        source.set_format(gst::Format::Time);
        // Pushing waits by itself: after an error nobody takes anything, and appsrc would block for ever.
        source.set_block(false);
        source.set_max_bytes(0);
        let sink = make("fdsink")?;
        sink.set_property("fd", file.as_raw_fd());
        sink.set_property("sync", false);
        let mut chain = vec![element];
        chain.extend(timestamper);
        chain.push(mux);
        chain.push(sink);
        let pipeline = gst::Pipeline::new();
        pipeline.add_many(&chain).map_err(|error| fault(&error))?;
        gst::Element::link_many(&chain).map_err(|error| fault(&error))?;
        let bus = pipeline.bus().ok_or_else(|| lacks("bus"))?;
        let writer = Self { pipeline, bus, source, recent_nanos: VecDeque::new(), _file: file };
        writer.pipeline.set_state(gst::State::Playing).map_err(|error| fault(&error))?;
        Ok(writer)
    }

    /// Adds a frame that is seen `nanos` after the clip's beginning. Frames come in decoding order. Waits where writing is
    /// slower, as long as `goes_on`.
    ///
    /// # Errors
    /// When it cannot be written, or is not waited for any more; nothing more can be written then.
    pub fn push(
        &mut self,
        frame: &EncodedFrame,
        nanos: u64,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<(), Fault> {
        while self.source.current_level_bytes() >= QUEUE_BYTES {
            if let Some(fault) = self.look() {
                return Err(fault);
            }
            if !goes_on() {
                return Err(given_up());
            }
        }
        // MP4 ends with the last frame's duration: without one, players leave out what is shown last.
        let interval = self.recent_nanos.iter().map(|other| other.abs_diff(nanos)).filter(|n| *n > 0).min();
        if self.recent_nanos.len() == REORDERED {
            self.recent_nanos.pop_front();
        }
        self.recent_nanos.push_back(nanos);
        let mut buffer = frame.buffer().copy();
        {
            let buffer = buffer.make_mut();
            buffer.set_pts(gst::ClockTime::from_nseconds(nanos));
            buffer.set_dts(gst::ClockTime::NONE);
            buffer.set_duration(interval.map(gst::ClockTime::from_nseconds));
        }
        let pushed = self.source.push_buffer(buffer);
        pushed
            .map(|_taken| ())
            .map_err(|error| self.failure().unwrap_or_else(|| gstreamer_fault(ACTION, &error)))
    }

    /// Writes the rest and the index, as long as `goes_on`.
    ///
    /// # Errors
    /// When they cannot be written, or are not waited for any more.
    pub fn finish(self, goes_on: &dyn Fn() -> bool) -> Result<(), Fault> {
        self.source.end_of_stream().map_err(|error| gstreamer_fault(ACTION, &error))?;
        for _ in 0..MAX_FINISH_LOOKS {
            let kinds = [gst::MessageType::Eos, gst::MessageType::Error];
            let message = self.bus.timed_pop_filtered(LOOK, &kinds);
            match message.as_ref().map(|message| message.view()) {
                Some(gst::MessageView::Eos(_)) => return Ok(()),
                Some(gst::MessageView::Error(error)) => return Err(told(error)),
                _ if !goes_on() => return Err(given_up()),
                _ => {}
            }
        }
        Err(Fault::Gstreamer { action: ACTION.into(), detail: "its end is not written".to_owned() })
    }

    /// Waits a moment for an error.
    fn look(&self) -> Option<Fault> {
        let message = self.bus.timed_pop_filtered(LOOK, &[gst::MessageType::Error])?;
        if let gst::MessageView::Error(error) = message.view() { Some(told(error)) } else { None }
    }

    /// What went wrong, if the pipeline said so.
    fn failure(&self) -> Option<Fault> {
        let message = self.bus.pop_filtered(&[gst::MessageType::Error])?;
        if let gst::MessageView::Error(error) = message.view() { Some(told(error)) } else { None }
    }
}

fn given_up() -> Fault {
    Fault::Gstreamer { action: ACTION.into(), detail: "it was broken off".to_owned() }
}

fn told(error: &gst::message::Error) -> Fault {
    let detail = error.error().message().trim_end_matches('.').to_owned();
    Fault::Gstreamer { action: ACTION.into(), detail }
}

impl Drop for ClipWriter {
    fn drop(&mut self) {
        if let Err(error) = self.pipeline.set_state(gst::State::Null) {
            tracing::warn!(%error, "a clip's writer did not stop");
        }
    }
}
