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

/// Bits of the number, each a band of columns.
const BITS: u32 = 12;

/// Columns and rows of a film whose writer asks for no other.
const USUAL_PX: (u32, u32) = (192, 96);

impl Numbered<'_> {
    /// Writes it to `path`.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write(&self, path: &Path) {
        self.write_sized(path, USUAL_PX);
    }

    /// Writes it to `path` with so many columns and rows.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write_sized(&self, path: &Path, size_px: (u32, u32)) {
        let rest = format!("{} ! {} ! filesink location={}", self.encoder, self.muxer, path.display());
        let pipeline = start_numbered((self.n_frames, self.rate_hz), size_px, &rest);
        let bus = pipeline.bus().unwrap();
        let ends = [gst::MessageType::Eos, gst::MessageType::Error];
        let end = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends).unwrap();
        assert!(matches!(end.view(), gst::MessageView::Eos(_)), "{rest}: {end:?}");
        pipeline.set_state(gst::State::Null).unwrap();
    }
}

/// Starts a pipeline into which so many pictures flow, each of which shows its own number, at so many a second; `rest` says what
/// becomes of them.
///
/// # Panics
/// When it cannot be built.
pub fn start_numbered(
    (n_frames, rate_hz): (u64, u32),
    (width, height): (u32, u32),
    rest: &str,
) -> gst::Pipeline {
    gst::init().unwrap();
    let format = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, width, height);
    let format = format.fps(gst::Fraction::new(rate_hz as i32, 1)).build().unwrap();
    let pipeline = gst::parse::launch(&format!("appsrc name=in format=time ! {rest}")).unwrap();
    let pipeline = pipeline.downcast::<gst::Pipeline>().unwrap();
    let source = pipeline.by_name("in").unwrap().downcast::<gst_app::AppSrc>().unwrap();
    source.set_caps(Some(&format.to_caps().unwrap()));
    pipeline.set_state(gst::State::Playing).unwrap();
    let luma_bytes = format.offset()[1];
    let row_bytes = format.stride()[0] as usize;
    for number in 0..n_frames {
        let mut data = vec![128_u8; format.size()];
        for row in data[..luma_bytes].chunks_mut(row_bytes).take(height as usize) {
            for (x, luma) in (0..width).zip(row) {
                *luma = luma_of(number, x, width);
            }
        }
        let mut buffer = gst::Buffer::from_mut_slice(data);
        let writable = buffer.get_mut().unwrap();
        writable.set_pts(gst::ClockTime::from_nseconds(number * 1_000_000_000 / u64::from(rate_hz)));
        writable.set_duration(gst::ClockTime::from_nseconds(1_000_000_000 / u64::from(rate_hz)));
        source.push_buffer(buffer).unwrap();
    }
    source.end_of_stream().unwrap();
    pipeline
}

/// Luma of a column of the picture that shows `number`.
#[must_use]
pub fn luma_of(number: u64, x: u32, width: u32) -> u8 {
    if number >> (x * BITS / width) & 1 == 1 { 220 } else { 30 }
}

/// The number that a frame of a [`Numbered`] film shows, also where it was turned a quarter to the right.
#[must_use]
pub fn number_of(image: &YuvImage) -> u64 {
    let luma = image.plane(0);
    let (width, height) = (luma.width, luma.height);
    let middle = |length: u32, bit: u32| (2 * bit + 1) * length / (2 * BITS);
    let bit_luma = |bit: u32| {
        if width > height {
            luma.row(height / 2)[middle(width, bit) as usize]
        } else {
            luma.row(middle(height, bit))[width as usize / 2]
        }
    };
    (0..BITS).filter(|bit| bit_luma(*bit) > 125).map(|bit| 1 << bit).sum()
}
