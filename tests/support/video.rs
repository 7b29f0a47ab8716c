//! Videos as a decoder gives them.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::path::Path;
use videofields::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage, YuvLayout};

/// All frames of a video as a decoder gives them, with their times, seconds.
///
/// # Panics
/// When it cannot be decoded.
#[must_use]
pub(crate) fn decode_timed(path: &Path) -> Vec<(RgbImage, f64)> {
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
