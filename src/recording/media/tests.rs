//! What goes in comes out again: files through decoder, tap and muxer, and back.

use super::*;
use gst::prelude::*;
use gstreamer as gst;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// Writes 40 frames of a test picture by `encoder` and `muxer`.
pub(super) fn write_video(path: &Path, encoder: &str, muxer: &str) {
    gst::init().unwrap();
    let description = format!(
        "videotestsrc num-buffers=40 pattern=ball ! video/x-raw,format=I420,width=160,height=120,framerate=20/1 ! \
         {encoder} ! {muxer} ! filesink location={}",
        path.display()
    );
    run(&gst::parse::launch(&description).unwrap());
}

/// Returns the bytes of a file's frames, and true for those with which decoding can begin, as another reader gives them.
pub(super) fn frames_of(path: &Path) -> impl Iterator<Item = (Vec<u8>, bool)> {
    let description = format!("filesrc location={} ! qtdemux ! appsink name=out sync=false", path.display());
    let pipeline = gst::parse::launch(&description).unwrap();
    let sink = pipeline.downcast_ref::<gst::Bin>().unwrap().by_name("out").unwrap();
    let sink = sink.downcast::<gstreamer_app::AppSink>().unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let mut frames = Vec::new();
    while let Ok(sample) = sink.pull_sample() {
        let buffer = sample.buffer().unwrap();
        let is_key = !buffer.flags().contains(gst::BufferFlags::DELTA_UNIT);
        frames.push((buffer.map_readable().unwrap().to_vec(), is_key));
    }
    pipeline.set_state(gst::State::Null).unwrap();
    frames.into_iter()
}

/// Runs `pipeline` to its end.
fn run(pipeline: &gst::Element) {
    pipeline.set_state(gst::State::Playing).unwrap();
    let bus = pipeline.bus().unwrap();
    let end = bus.timed_pop_filtered(
        gst::ClockTime::from_seconds(60),
        &[gst::MessageType::Eos, gst::MessageType::Error],
    );
    assert!(matches!(end.unwrap().view(), gst::MessageView::Eos(_)));
    pipeline.set_state(gst::State::Null).unwrap();
}

/// Every picture's time, and the sum of its luma.
fn pictures(mut decoder: Decoder) -> Vec<(Option<i64>, u64)> {
    let mut seen = Vec::new();
    while !decoder.has_ended() {
        if let Some(Picture { image, stream_nanos, .. }) = decoder.pull(Duration::from_millis(100)) {
            let luma = image.plane(0);
            let sum = (0..luma.height).flat_map(|y| luma.row(y)).map(|luma| u64::from(*luma)).sum();
            seen.push((stream_nanos, sum));
        }
        if let Some(fault) = decoder.fault() {
            panic!("{fault}");
        }
    }
    seen
}

/// Codecs that cameras send, with what writes them here and whether frames come in another order than they are seen.
const CODECS: [(&str, &str, &str); 7] = [
    ("video/x-h264", "x264enc bframes=2 key-int-max=10 tune=0", "mp4mux"),
    ("video/x-h264", "x264enc bframes=2 key-int-max=10 tune=0", "flvmux"),
    ("video/x-h264", "x264enc tune=zerolatency key-int-max=10 byte-stream=true", "mpegtsmux"),
    ("image/jpeg", "jpegenc", "avimux"),
    ("video/mpeg", "avenc_mpeg4 bitrate=400000 gop-size=10", "mp4mux"),
    ("video/x-divx", "avenc_mpeg4 bitrate=400000 gop-size=10", "avimux"),
    ("video/x-vp8", "vp8enc deadline=1 keyframe-max-dist=10", "webmmux"),
];

#[test]
fn encoded_frames_in_matroska_show_the_same_pictures_at_the_same_times() {
    let folder = tempfile::tempdir().unwrap();
    for (codec, encoder, muxer) in CODECS {
        let path = folder.path().join("video");
        write_video(&path, encoder, muxer);
        let plain = pictures(Decoder::start(Input::file(&path).unwrap(), None).unwrap());
        assert_eq!(plain.len(), 40, "{codec}");
        let queue = Arc::new(EncodedQueue::new(1 << 20));
        let tapped = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
        assert_eq!(pictures(tapped), plain, "{codec}: the tap changes nothing");
        let frames: Vec<EncodedFrame> = std::iter::from_fn(|| queue.take()).collect();
        assert_eq!((frames.len(), queue.n_dropped()), (40, 0), "{codec}");
        assert_eq!((frames[0].format.codec(), frames[0].format.size_px()), (codec, Some((160, 120))));
        assert!(frames[0].is_key, "{codec}");

        let first = plain[0].0.unwrap();
        let mut muxer = Muxer::start(&frames[0].format).unwrap();
        let (mut bytes, mut written) = (Vec::new(), Vec::new());
        for (frame, place) in frames.iter().zip(0_i64..) {
            let n_before = bytes.len();
            // AVI says the times of key frames alone.
            let told = frame.stream_nanos.map(|nanos| nanos - first);
            let nanos = u64::try_from(told.unwrap_or(place * 50_000_000)).unwrap();
            written.push(Some(nanos as i64));
            muxer.push(frame, nanos, &mut bytes).unwrap();
            assert!(bytes.len() > n_before, "a frame comes out as it goes in");
        }
        let mut demuxer = Demuxer::start(Input::stream(std::io::Cursor::new(bytes.clone()))).unwrap();
        let read = std::iter::from_fn(|| demuxer.frame(&|| true).unwrap()).map(|frame| frame.stream_nanos);
        assert_eq!(read.collect::<Vec<_>>(), written, "{codec}: the times of its blocks");
        let back = pictures(Decoder::start(Input::stream(std::io::Cursor::new(bytes)), None).unwrap());
        let expected: Vec<_> =
            plain.iter().map(|(nanos, sum)| (nanos.map(|nanos| nanos - first), *sum)).collect();
        assert_eq!(back, expected, "{codec}");
    }
}

/// A pool keeps what it is given back for as long as its decoder lives, but for what bears this flag.
#[test]
fn pictures_of_a_stream_are_freed_and_those_of_a_camera_go_back_to_their_pool() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video");
    write_video(&path, "x264enc bframes=2 key-int-max=10 tune=0", "matroskamux");
    let n_freed = |source: input::Source| {
        let pipeline = pipeline::Pipeline::start(source, None).unwrap();
        let samples = std::iter::repeat_with(|| pipeline.pull(Duration::from_secs(10))).take(40);
        let is_freed =
            |sample: &gst::Sample| sample.buffer().unwrap().flags().contains(gst::BufferFlags::TAG_MEMORY);
        samples.map(Option::unwrap).filter(is_freed).count()
    };
    assert_eq!(n_freed(input::Source::stream(std::fs::File::open(&path).unwrap()).unwrap()), 40);
    assert_eq!(n_freed(input::Source::file(&path).unwrap()), 0);
}

#[test]
fn who_pads_rows_is_not_made_to_copy_them() {
    gst::init().unwrap();
    let caps: gst::Caps = "video/x-raw,format=I420,width=160,height=120".parse().unwrap();
    for keep in [input::Keep::All, input::Keep::Newest] {
        let mut question = gst::query::Allocation::new(Some(&caps), false);
        let sink = sink::make_sink(keep, None);
        let _ = sink.static_pad("sink").unwrap().query(question.query_mut());
        assert!(question.find_allocation_meta::<gstreamer_video::VideoMeta>().is_some(), "{keep:?}");
    }
}

/// So write some who hand an encoder pictures without times.
#[test]
fn files_whose_frames_all_bear_one_time_lose_none_of_them() {
    gst::init().unwrap();
    let folder = tempfile::tempdir().unwrap();
    for encoder in
        ["x264enc bframes=0 key-int-max=10", "x265enc key-int-max=10 option-string=bframes=0 ! h265parse"]
    {
        let path = folder.path().join("video.mp4");
        let description = format!(
            "videotestsrc num-buffers=40 pattern=ball ! video/x-raw,format=I420,width=160,height=120,framerate=10/1 ! \
             {encoder} ! identity name=stand ! mp4mux ! filesink location={}",
            path.display()
        );
        let pipeline = gst::parse::launch(&description).unwrap();
        let stand = pipeline.downcast_ref::<gst::Bin>().unwrap().by_name("stand").unwrap();
        let first = std::sync::OnceLock::new();
        stand.static_pad("src").unwrap().add_probe(gst::PadProbeType::BUFFER, move |_pad, info| {
            let buffer = info.buffer_mut().unwrap().make_mut();
            let time = *first.get_or_init(|| buffer.pts().unwrap());
            buffer.set_pts(time);
            buffer.set_dts(time);
            gst::PadProbeReturn::Ok
        });
        run(&pipeline);
        let plain = pictures(Decoder::start(Input::file(&path).unwrap(), None).unwrap());
        let queue = Arc::new(EncodedQueue::new(1 << 20));
        let tapped = pictures(Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap());
        let n_encoded = std::iter::from_fn(|| queue.take()).count();
        assert_eq!((plain.len(), tapped.len(), n_encoded), (40, 40, 40), "{encoder}");
    }
}

/// So telephones write: as the sensor lies, with a word on how it was held.
#[test]
fn pictures_that_are_to_be_turned_are_turned_and_recorded_so() {
    gst::init().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mp4");
    // Bright at the top alone.
    let write = |[a, b, c, d]: [i32; 4]| {
        let description = format!(
            "appsrc name=in format=time caps=video/x-raw,format=I420,width=160,height=96,framerate=10/1 ! \
             x264enc tune=zerolatency ! mp4mux ! filesink location={}",
            path.display()
        );
        let pipeline = gst::parse::launch(&description).unwrap();
        let source = pipeline.downcast_ref::<gst::Bin>().unwrap().by_name("in").unwrap();
        let source = source.downcast::<gstreamer_app::AppSrc>().unwrap();
        for n in 0..5 {
            let luma = (0..160 * 96).map(|at| if at < 160 * 48 { 220 } else { 40 });
            let mut buffer = gst::Buffer::from_mut_slice(luma.chain([128; 80 * 48 * 2]).collect::<Vec<u8>>());
            buffer.get_mut().unwrap().set_pts(gst::ClockTime::from_mseconds(100 * n));
            source.push_buffer(buffer).unwrap();
        }
        source.end_of_stream().unwrap();
        run(&pipeline);
        // The matrix in the header of the track, 16.16 (ISO/IEC 14496-12, 8.3.2).
        let mut bytes = std::fs::read(&path).unwrap();
        let header = bytes.windows(4).position(|name| name == b"tkhd").unwrap();
        for (at, value) in [a, b, 0, c, d].into_iter().enumerate() {
            let at = header + 44 + 4 * at;
            bytes[at..at + 4].copy_from_slice(&(value << 16).to_be_bytes());
        }
        std::fs::write(&path, bytes).unwrap();
    };
    // Sides at which the bright half is then: left, right, top, bottom.
    let bright = |luma: &videofields_vision::frame::Plane<'_>| {
        let at = |x: u32, y: u32| luma.row(y)[x as usize] > 130;
        let (width, height) = (luma.width, luma.height);
        [at(4, height / 2), at(width - 5, height / 2), at(width / 2, 4), at(width / 2, height - 5)]
    };
    for (orientation, matrix, size, expected) in [
        (0, [1, 0, 0, 1], (160, 96), [true, true, true, false]),
        (90, [0, 1, -1, 0], (96, 160), [false, true, true, true]),
        (180, [-1, 0, 0, -1], (160, 96), [false, false, false, true]),
        (270, [0, -1, 1, 0], (96, 160), [true, false, true, true]),
    ] {
        write(matrix);
        let queue = Arc::new(EncodedQueue::new(1 << 20));
        let mut decoder = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
        let picture = decoder.pull(Duration::from_secs(10)).unwrap();
        assert_eq!((picture.image.width(), picture.image.height()), size, "{orientation}");
        let [left, right, top, bottom] = bright(&picture.image.plane(0));
        if orientation % 180 == 90 {
            assert_eq!([left, right], expected[..2], "{orientation}");
        } else {
            assert_eq!([top, bottom], expected[2..], "{orientation}");
        }
        let is_turned = orientation != 0;
        // Its own frames would be shown as they lie.
        assert_eq!((queue.wants_pictures(), queue.take().is_none()), (is_turned, is_turned), "{orientation}");
    }
}

/// So do cameras of analogue sizes, and some whose stream is narrower than their sensor.
#[test]
fn pictures_of_pixels_that_are_not_square_are_stretched_also_when_that_begins_in_mid_stream() {
    gst::init().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, shape: &str| {
        let path = folder.path().join(name);
        run(&gst::parse::launch(&format!(
            "videotestsrc num-buffers=5 pattern=smpte ! \
             video/x-raw,format=I420,width=180,height=144,framerate=10/1,pixel-aspect-ratio={shape} ! \
             x264enc tune=zerolatency ! video/x-h264,stream-format=byte-stream ! filesink location={}",
            path.display()
        ))
        .unwrap());
        std::fs::read(path).unwrap()
    };
    let (square, wide) = (write("square.h264", "1/1"), write("wide.h264", "16/15"));
    let path = folder.path().join("both.h264");
    std::fs::write(&path, [square, wide].concat()).unwrap();
    let queue = Arc::new(EncodedQueue::new(1 << 20));
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
    for expected in [[(180, 144); 5], [(192, 144); 5]].concat() {
        let picture = decoder.pull(Duration::from_secs(10)).unwrap();
        assert_eq!((picture.image.width(), picture.image.height()), expected);
        // The last of seven bars is dark: it begins where it did, by its part of the width.
        let luma = picture.image.plane(0);
        let first_dark = luma.row(20).iter().rposition(|value| *value > 60).unwrap();
        let part = first_dark as f64 / luma.row(20).len() as f64;
        assert!((part - 6.0 / 7.0).abs() < 0.02, "{part}");
    }
    assert!(!queue.wants_pictures(), "the stream itself says how its pixels are shaped");
}
