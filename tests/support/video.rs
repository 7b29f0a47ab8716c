//! Videos as a decoder gives them.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::path::Path;
use videofields_vision::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage, YuvLayout};

/// All frames of a video as a decoder gives them, with their times, seconds.
///
/// # Panics
/// When it cannot be decoded.
#[must_use]
pub fn decode_timed(path: &Path) -> Vec<(RgbImage, f64)> {
    gst::init().unwrap();
    let description =
        "filesrc name=file ! decodebin ! appsink name=out sync=false caps=video/x-raw,format=I420";
    let pipeline = gst::parse::launch(description).unwrap().downcast::<gst::Pipeline>().unwrap();
    pipeline.by_name("file").unwrap().set_property("location", path);
    let sink = pipeline.by_name("out").unwrap().downcast::<gst_app::AppSink>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let mut frames = Vec::new();
    while let Ok(sample) = sink.pull_sample() {
        let info = gst_video::VideoInfo::from_caps(sample.caps().unwrap()).unwrap();
        assert_eq!(info.colorimetry().matrix(), gst_video::VideoColorMatrix::Bt601);
        assert_eq!(info.colorimetry().range(), gst_video::VideoColorRange::Range16_235);
        let buffer = sample.buffer_owned().unwrap();
        let secs = buffer.pts().unwrap().nseconds() as f64 * 1e-9;
        let frame = gst_video::VideoFrame::from_buffer_readable(buffer, &info).unwrap();
        let layout = YuvLayout::packed(info.width(), info.height());
        let mut data = Vec::new();
        for plane in 0..3 {
            let width = if plane == 0 { layout.width } else { layout.chroma_width() } as usize;
            let height = if plane == 0 { layout.height } else { layout.chroma_height() } as usize;
            let stride = info.stride()[plane as usize] as usize;
            for row in frame.plane_data(plane).unwrap().chunks(stride).take(height) {
                data.extend_from_slice(&row[..width]);
            }
        }
        let yuv = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
        frames.push((yuv.to_rgb(), secs));
    }
    assert!(sink.is_eos(), "{}: the pipeline failed", path.display());
    pipeline.set_state(gst::State::Null).unwrap();
    frames
}

/// A film of which each frame shows its own number.
pub struct Numbered<'a> {
    /// How many frames there are.
    pub n_frames: u64,
    /// Frames a second.
    pub rate_hz: u32,
    /// Element and properties that encode it.
    pub encoder: &'a str,
    /// Element that puts it into a container.
    pub muxer: &'a str,
}

/// Columns of one bit of the number, and rows of the picture.
const BIT_PX: u32 = 16;
const BITS: u32 = 12;
const ROWS: u32 = 96;

impl Numbered<'_> {
    /// Writes it to `path`.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write(&self, path: &Path) {
        gst::init().unwrap();
        let (width, height) = (BITS * BIT_PX, ROWS);
        let description = format!(
            "appsrc name=in format=time caps=video/x-raw,format=I420,width={width},height={height},framerate={}/1 ! \
             {} ! {} ! filesink location={}",
            self.rate_hz,
            self.encoder,
            self.muxer,
            path.display()
        );
        let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
        let source = pipeline.by_name("in").unwrap().downcast::<gst_app::AppSrc>().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        for number in 0..self.n_frames {
            let mut data = vec![128_u8; (width * height * 3 / 2) as usize];
            for (i, luma) in data[..(width * height) as usize].iter_mut().enumerate() {
                let bit = i as u32 % width / BIT_PX;
                *luma = if number >> bit & 1 == 1 { 220 } else { 30 };
            }
            let mut buffer = gst::Buffer::from_mut_slice(data);
            let writable = buffer.get_mut().unwrap();
            writable.set_pts(gst::ClockTime::from_nseconds(number * 1_000_000_000 / u64::from(self.rate_hz)));
            writable.set_duration(gst::ClockTime::from_nseconds(1_000_000_000 / u64::from(self.rate_hz)));
            source.push_buffer(buffer).unwrap();
        }
        source.end_of_stream().unwrap();
        let bus = pipeline.bus().unwrap();
        let ends = [gst::MessageType::Eos, gst::MessageType::Error];
        let end = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends).unwrap();
        assert!(matches!(end.view(), gst::MessageView::Eos(_)), "{description}: {end:?}");
        pipeline.set_state(gst::State::Null).unwrap();
    }
}

/// The number that a frame of a [`Numbered`] film shows.
///
/// # Panics
/// When the picture is not of such a film's size.
#[must_use]
pub fn number_of(image: &YuvImage) -> u64 {
    assert_eq!((image.width(), image.height()), (BITS * BIT_PX, ROWS));
    let luma = image.plane(0).row(ROWS / 2);
    let middle = |bit: u32| luma[(bit * BIT_PX + BIT_PX / 2) as usize];
    (0..BITS).filter(|bit| middle(*bit) > 125).map(|bit| 1 << bit).sum()
}
