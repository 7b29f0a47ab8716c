//! Films of MPEG-4 part 2 with the times that their encoder leaves out.

use super::Numbered;
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use std::path::Path;
use videofields_testing::video::start_numbered;

/// Writes a film whose encoder says no times (that of libav does not, with `GStreamer` 1.22).
pub(super) fn write(film: &Numbered<'_>, path: &Path, size_px: (u32, u32)) {
    let Numbered { n_frames, rate_hz, encoder, muxer } = *film;
    let rest = format!("{encoder} ! appsink name=out sync=false max-buffers=0");
    let pipeline = start_numbered((n_frames, rate_hz), size_px, &rest);
    let sink = pipeline.by_name("out").unwrap().downcast::<gst_app::AppSink>().unwrap();
    let samples: Vec<_> = std::iter::from_fn(|| sink.pull_sample().ok()).collect();
    pipeline.set_state(gst::State::Null).unwrap();
    assert_eq!(samples.len() as u64, n_frames, "{encoder}");

    let description = format!("appsrc name=in format=time ! {muxer} ! filesink location={}", path.display());
    let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
    let source = pipeline.by_name("in").unwrap().downcast::<gst_app::AppSrc>().unwrap();
    source.set_caps(samples[0].caps_owned().as_ref());
    pipeline.set_state(gst::State::Playing).unwrap();
    let buffers: Vec<_> = samples.iter().map(|sample| sample.buffer_owned().unwrap()).collect();
    let kinds: Vec<_> = buffers.iter().map(is_between).collect();
    let interval = gst::ClockTime::from_nseconds(1_000_000_000 / u64::from(rate_hz));
    for (place, (mut buffer, shown)) in buffers.into_iter().zip(places_shown(&kinds)).enumerate() {
        let writable = buffer.make_mut();
        // No frame is decoded after it is shown.
        writable.set_pts(interval * (shown as u64 + 1));
        writable.set_dts(interval * place as u64);
        source.push_buffer(buffer).unwrap();
    }
    source.end_of_stream().unwrap();
    let ends = [gst::MessageType::Eos, gst::MessageType::Error];
    let end = pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends).unwrap();
    assert!(matches!(end.view(), gst::MessageView::Eos(_)), "{description}: {end:?}");
    pipeline.set_state(gst::State::Null).unwrap();
}

/// Returns true for a frame that is predicted from one before and one after it (a B-VOP: ISO/IEC 14496-2, 6.2.5).
fn is_between(buffer: &gst::Buffer) -> bool {
    let bytes = buffer.map_readable().unwrap();
    let start = bytes.windows(4).position(|code| code == [0, 0, 1, 0xb6]).unwrap();
    bytes[start + 4] >> 6 == 2
}

/// The place at which each of the frames is shown: those between two others in the order in which they come, all others once
/// the next of them has come.
fn places_shown(are_between: &[bool]) -> Vec<usize> {
    let mut places = vec![0; are_between.len()];
    let (mut next, mut held) = (0, None);
    for (idx, is_between) in are_between.iter().enumerate() {
        let shown = if *is_between { Some(idx) } else { held.replace(idx) };
        if let Some(shown) = shown {
            places[shown] = next;
            next += 1;
        }
    }
    if let Some(last) = held {
        places[last] = next;
    }
    places
}
