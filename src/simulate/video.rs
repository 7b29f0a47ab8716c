//! Pictures into a VP8 video in WebM, through GStreamer.
//!
//! Frames go in as sRGB, one after another at a fixed rate; a file comes out. VP8 because its encoder and muxer are
//! part of gst-plugins-good, which the daemon needs anyway to read files. One quantiser for every frame keeps the
//! error alike over the whole clip, where a rate control would let it breathe.

use super::SimulateError;
use crate::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage};
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::path::{Path, PathBuf};

/// VP8's quantiser index, 0 (best) to 63.
const QUANTIZER: i32 = 4;
/// Frames from one key frame to the next at most: seeking needs them, each costs as much as dozens of others.
const KEY_FRAME_DISTANCE: i32 = 120;
/// Frames that wait for the encoder before the caller does.
const QUEUED_FRAMES: u64 = 4;

/// A video file being written.
pub(super) struct VideoWriter {
    pipeline: gst::Pipeline,
    source: gst_app::AppSrc,
    info: gst_video::VideoInfo,
    path: PathBuf,
    rate_hz: f64,
    n_frames: u64,
}

impl VideoWriter {
    /// Begins a file at `path` for pictures of `size_px` at `rate_hz` frames a second.
    pub(super) fn create(path: &Path, size_px: (u32, u32), rate_hz: f64) -> Result<Self, SimulateError> {
        let fault = |what: String| SimulateError::Video { path: path.to_owned(), what };
        gst::init().map_err(|error| fault(error.to_string()))?;
        let rate = gst::Fraction::approximate_f64(rate_hz)
            .ok_or_else(|| fault(format!("a rate of {rate_hz} Hz is no fraction")))?;
        // VP8 has one matrix, BT.601 [RFC 6386 section 9.2]; the caps say the same.
        let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, size_px.0, size_px.1)
            .fps(rate)
            .colorimetry(&gst_video::VideoColorimetry::new(
                gst_video::VideoColorRange::Range16_235,
                gst_video::VideoColorMatrix::Bt601,
                gst_video::VideoTransferFunction::Bt601,
                gst_video::VideoColorPrimaries::Smpte170m,
            ))
            .build()
            .map_err(|error| fault(error.to_string()))?;
        let caps = info.to_caps().map_err(|error| fault(error.to_string()))?;
        let source = gst_app::AppSrc::builder()
            .caps(&caps)
            .format(gst::Format::Time)
            .block(true)
            .max_bytes(QUEUED_FRAMES * info.size() as u64)
            .build();
        let encoder = element("vp8enc")?;
        encoder.set_property("min-quantizer", QUANTIZER);
        encoder.set_property("max-quantizer", QUANTIZER);
        encoder.set_property("keyframe-max-dist", KEY_FRAME_DISTANCE);
        // The slower of libvpx's two offline grades, on one thread so that the same frames give the same bits.
        encoder.set_property("deadline", 1_000_000_i64);
        encoder.set_property("threads", 1_i32);
        let muxer = element("webmmux")?;
        muxer.set_property("writing-app", "videofields");
        let sink = element("filesink")?;
        sink.set_property("location", path);
        let pipeline = gst::Pipeline::new();
        let elements = [source.upcast_ref(), &encoder, &muxer, &sink];
        pipeline.add_many(elements).map_err(|error| fault(error.to_string()))?;
        gst::Element::link_many(elements).map_err(|error| fault(error.to_string()))?;
        let writer = Self { pipeline, source, info, path: path.to_owned(), rate_hz, n_frames: 0 };
        writer.pipeline.set_state(gst::State::Playing).map_err(|error| writer.fault(error.to_string()))?;
        Ok(writer)
    }

    /// Adds a picture.
    pub(super) fn push(&mut self, rgb: &RgbImage) -> Result<(), SimulateError> {
        let yuv = YuvImage::from_rgb(rgb, ColorMatrix::Bt601, ColorRange::Limited)
            .map_err(|error| self.fault(error.to_string()))?;
        let buffer =
            gst::Buffer::with_size(self.info.size()).map_err(|error| self.fault(error.to_string()))?;
        let mut frame = gst_video::VideoFrame::from_buffer_writable(buffer, &self.info)
            .map_err(|_buffer| self.fault("the frame's buffer cannot be written".to_owned()))?;
        for plane in 0..3_usize {
            let rows = yuv.plane(plane);
            let stride = self.info.stride()[plane] as usize;
            let data = frame.plane_data_mut(plane as u32).map_err(|error| self.fault(error.to_string()))?;
            for (y, out) in (0..rows.height).zip(data.chunks_mut(stride)) {
                out[..rows.width as usize].copy_from_slice(rows.row(y));
            }
        }
        let mut buffer = frame.into_buffer();
        let nanos_at = |frame: u64| (frame as f64 / self.rate_hz * 1e9).round() as u64;
        let (start, end) = (nanos_at(self.n_frames), nanos_at(self.n_frames + 1));
        let writable = buffer.make_mut();
        writable.set_pts(gst::ClockTime::from_nseconds(start));
        writable.set_duration(gst::ClockTime::from_nseconds(end - start));
        self.n_frames += 1;
        self.source.push_buffer(buffer).map(|_flowing| ()).map_err(|error| {
            // The pipeline's own message says more than "error".
            self.pipeline_error().unwrap_or_else(|| self.fault(error.to_string()))
        })
    }

    /// Ends the file; only then can it be read.
    pub(super) fn finish(self) -> Result<(), SimulateError> {
        self.source.end_of_stream().map_err(|error| self.fault(error.to_string()))?;
        let bus = self.pipeline.bus().ok_or_else(|| self.fault("the pipeline has no bus".to_owned()))?;
        let wanted = [gst::MessageType::Eos, gst::MessageType::Error];
        match bus.timed_pop_filtered(gst::ClockTime::NONE, &wanted) {
            Some(message) => match message.view() {
                gst::MessageView::Error(error) => Err(self.fault(error.error().to_string())),
                _ => Ok(()),
            },
            None => Err(self.fault("the pipeline was shut down before the end".to_owned())),
        }
    }

    fn pipeline_error(&self) -> Option<SimulateError> {
        let message = self.pipeline.bus()?.pop_filtered(&[gst::MessageType::Error])?;
        match message.view() {
            gst::MessageView::Error(error) => Some(self.fault(error.error().to_string())),
            _ => None,
        }
    }

    fn fault(&self, what: String) -> SimulateError {
        SimulateError::Video { path: self.path.clone(), what }
    }
}

impl Drop for VideoWriter {
    fn drop(&mut self) {
        if let Err(error) = self.pipeline.set_state(gst::State::Null) {
            tracing::warn!(path = %self.path.display(), %error, "a video's pipeline did not stop");
        }
    }
}

fn element(name: &'static str) -> Result<gst::Element, SimulateError> {
    gst::ElementFactory::make(name).build().map_err(|error| {
        tracing::debug!(%error, "element");
        SimulateError::NoElement { name }
    })
}
