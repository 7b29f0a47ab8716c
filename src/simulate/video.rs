//! Pictures into a VP8 video in WebM, through GStreamer.
//!
//! Frames go in as sRGB, each with its place in the file; a file comes out. VP8 because its encoder and muxer are
//! part of gst-plugins-good, which the daemon needs anyway to read files. One quantiser for every frame keeps the
//! error alike over the whole clip, where a rate control would let it breathe.

use super::SimulateError;
use super::effects::{Effects, Entries};
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use videofields_vision::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage};

/// How the encoder spends its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Codec {
    /// VP8's quantiser index, 0 (best) to 63: the least and the largest that the encoder may choose.
    pub(super) quantizers: (u32, u32),
    /// What it may spend, if the quantiser may vary.
    pub(super) bitrate_kbit_per_sec: Option<u32>,
    /// Frames from one key frame to the next at most: seeking needs them, each costs as much as dozens of others.
    pub(super) key_frame_distance: u32,
}

impl Codec {
    /// One quantiser for all frames, near what the sensor gave.
    const FINE: Self = Self { quantizers: (4, 4), bitrate_kbit_per_sec: None, key_frame_distance: 120 };

    /// The codec of a world's cameras.
    pub(super) fn of(effects: &Effects, entries: &Entries) -> Self {
        effects.compression.as_ref().map_or(Self::FINE, |compression| Self {
            quantizers: compression.quantizers(&entries.tally()),
            bitrate_kbit_per_sec: compression.bitrate_kbit_per_sec,
            key_frame_distance: compression.key_frame_distance,
        })
    }
}

/// Changes the bytes of an encoded frame.
pub(super) type Damager = Box<dyn FnOnce(&mut [u8]) + Send>;
/// What is to be done to encoded frames, by their place in the file.
type Damages = Arc<Mutex<BTreeMap<gst::ClockTime, Damager>>>;

/// Frames that wait for the encoder before the caller does.
const QUEUED_FRAMES: u64 = 4;

/// A video file being written.
pub(super) struct VideoWriter {
    pipeline: gst::Pipeline,
    source: gst_app::AppSrc,
    info: gst_video::VideoInfo,
    path: PathBuf,
    damages: Damages,
}

impl VideoWriter {
    /// Begins a file at `path` for pictures of `size_px` at about `rate_hz` frames a second.
    pub(super) fn create(
        path: &Path,
        size_px: (u32, u32),
        rate_hz: f64,
        codec: &Codec,
    ) -> Result<Self, SimulateError> {
        let sink = || {
            let sink = element("filesink")?;
            sink.set_property("location", path);
            Ok(sink)
        };
        Self::create_into(sink, path, size_px, rate_hz, codec)
    }

    /// As [`Self::create`], but what comes out is thrown away.
    pub(super) fn nowhere(size_px: (u32, u32), rate_hz: f64, codec: &Codec) -> Result<Self, SimulateError> {
        let sink = || {
            let sink = element("fakesink")?;
            sink.set_property("sync", false);
            Ok(sink)
        };
        Self::create_into(sink, Path::new("(nowhere)"), size_px, rate_hz, codec)
    }

    fn create_into(
        sink: impl FnOnce() -> Result<gst::Element, SimulateError>,
        path: &Path,
        size_px: (u32, u32),
        rate_hz: f64,
        codec: &Codec,
    ) -> Result<Self, SimulateError> {
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
        // The settings hold these to ranges that fit an i32.
        encoder.set_property("min-quantizer", codec.quantizers.0 as i32);
        encoder.set_property("max-quantizer", codec.quantizers.1 as i32);
        encoder.set_property("keyframe-max-dist", codec.key_frame_distance as i32);
        if let Some(rate) = codec.bitrate_kbit_per_sec {
            encoder.set_property("target-bitrate", (rate * 1000) as i32);
            encoder.set_property_from_str("end-usage", "cbr");
        }
        // The slower of libvpx's two offline grades, on one thread so that the same frames give the same bits.
        encoder.set_property("deadline", 1_000_000_i64);
        encoder.set_property("threads", 1_i32);
        let muxer = element("webmmux")?;
        muxer.set_property("writing-app", "videofields");
        let sink = sink()?;
        let pipeline = gst::Pipeline::new();
        let elements = [source.upcast_ref(), &encoder, &muxer, &sink];
        pipeline.add_many(elements).map_err(|error| fault(error.to_string()))?;
        gst::Element::link_many(elements).map_err(|error| fault(error.to_string()))?;
        let damages = Damages::default();
        damage_encoded(&encoder, &damages).ok_or_else(|| fault("the encoder has no way out".to_owned()))?;
        let writer = Self { pipeline, source, info, path: path.to_owned(), damages };
        writer.pipeline.set_state(gst::State::Playing).map_err(|error| writer.fault(error.to_string()))?;
        Ok(writer)
    }

    /// Adds a picture that is shown from `start_secs` for `duration_secs`; pictures come in the order of their times.
    pub(super) fn push(
        &mut self,
        rgb: &RgbImage,
        start_secs: f64,
        duration_secs: f64,
        damage: Option<Damager>,
    ) -> Result<(), SimulateError> {
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
        let nanos = |secs: f64| gst::ClockTime::from_nseconds((secs * 1e9).round() as u64);
        let start = nanos(start_secs);
        let writable = buffer.make_mut();
        writable.set_pts(start);
        writable.set_duration(nanos(start_secs + duration_secs) - start);
        if let Some(damage) = damage {
            self.damages.lock().unwrap_or_else(PoisonError::into_inner).insert(start, damage);
        }
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

/// Lets encoded frames be changed on their way from the encoder; `None` if it has no way out.
fn damage_encoded(encoder: &gst::Element, damages: &Damages) -> Option<()> {
    let damages = Arc::clone(damages);
    encoder.static_pad("src")?.add_probe(gst::PadProbeType::BUFFER, move |_pad, info| {
        let Some(buffer) = info.buffer_mut() else { return gst::PadProbeReturn::Ok };
        let damage =
            buffer.pts().and_then(|pts| damages.lock().unwrap_or_else(PoisonError::into_inner).remove(&pts));
        if let Some(damage) = damage {
            match buffer.make_mut().map_writable() {
                Ok(mut bytes) => damage(&mut bytes),
                Err(error) => tracing::warn!(%error, "an encoded frame could not be damaged"),
            }
        }
        gst::PadProbeReturn::Ok
    })?;
    Some(())
}

fn element(name: &'static str) -> Result<gst::Element, SimulateError> {
    gst::ElementFactory::make(name).build().map_err(|error| {
        tracing::debug!(%error, "element");
        SimulateError::NoElement { name }
    })
}
