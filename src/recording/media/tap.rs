//! Takes a stream's frames as they are encoded: to be recorded, and to be decoded by a worker.
//!
//! A camera's: `parsebin ! [parser ! capsfilter !] appsink`. A file's that a worker reads,
//! `parsebin ! [parser ! capsfilter !] tee ! decodebin`, and `tee ! appsink` into an [`EncodedQueue`]. The sink's callback
//! runs on the stream's own thread and never waits. A stream that Matroska does not hold goes to `decodebin` alone, and the
//! queue says that pictures are wanted instead; so it does where pictures are turned.

use super::announced::{Content, nal_content};
use super::fault::gstreamer_fault;
use super::frame_number::number_buffers;
use super::linking::{link_first, link_video, turns_pictures};
use super::pipeline::Parts;
use super::{EncodedFormat, EncodedFrame, EncodedQueue, Muxer, Times};
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use videofields_vision::lock::lock;

/// Takes encoded frames, one after the other.
pub(super) type FrameHandler = Box<dyn Fn(&gst::SampleRef) + Send + Sync>;

/// Links the first video of `parse` to `decode` and to `queue`.
pub(super) fn split_first_video(
    parse: &gst::Element,
    decode: &gst::Element,
    parts: &Parts<'_>,
    queue: &Arc<EncodedQueue>,
) {
    let (decode, queue) = (decode.clone(), Arc::clone(queue));
    link_first(parse, parts, is_video, move |pad, caps, pipeline| {
        let Some(stream) = caps.structure(0) else { return Ok(()) };
        let linked = if Muxer::takes(stream.name()) {
            split(pad, stream, pipeline, (&decode, &queue))
        } else {
            queue.want_pictures();
            pass_on(pad, pipeline, &decode)
        };
        linked.map_err(|error| gstreamer_fault("split a stream", &*error))
    });
}

/// Hands the first video of `parse` over, frame by frame: to `take`, and to the queue where it can be recorded so. One that comes
/// unencoded is linked to the pipeline's own sink.
pub(super) fn hand_over_first_video(
    parse: &gst::Element,
    parts: &Parts<'_>,
    (queue, take): (Option<&Arc<EncodedQueue>>, FrameHandler),
) {
    let (pictures, keep) = (parts.sink.downgrade(), parts.keep);
    let (queue, take) = (queue.cloned(), Mutex::new(Some(take)));
    let (has_ended, n_damaged) = (Arc::clone(parts.has_handed_over_all), Arc::clone(parts.n_damaged));
    link_first(parse, parts, is_video, move |pad, caps, pipeline| {
        let (Some(pictures), Some(stream)) = (pictures.upgrade(), caps.structure(0)) else { return Ok(()) };
        let is_recorded = Muxer::takes(stream.name());
        if let Some(queue) = queue.as_ref().filter(|_| !is_recorded) {
            queue.want_pictures();
        }
        if stream.name() == "video/x-raw" {
            return link_video(pad, caps, pipeline, (&pictures, keep));
        }
        let Some(take) = lock(&take).take() else { return Ok(()) };
        let queue = queue.clone().filter(|_| is_recorded);
        let linked =
            hand_over(pad, stream, pipeline, make_sink(queue.as_ref(), Some(take), (&has_ended, &n_damaged)));
        linked.map_err(|error| gstreamer_fault("hand over a stream", &*error))
    });
}

fn is_video(kind: &str) -> bool {
    kind.starts_with("video/") || kind.starts_with("image/")
}

/// Builds what stands between a parsed stream and who takes its frames.
fn hand_over(
    pad: &gst::Pad,
    stream: &gst::StructureRef,
    pipeline: &gst::Pipeline,
    sink: gst_app::AppSink,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut chain = packaging(stream)?;
    chain.push(sink.upcast());
    pipeline.add_many(&chain)?;
    gst::Element::link_many(&chain)?;
    for element in chain.iter().rev() {
        element.sync_state_with_parent()?;
    }
    let first = chain[0].static_pad("sink").ok_or("an element has no sink pad")?;
    pad.link(&first)?;
    Ok(())
}

/// Links a stream that is not recorded as it comes to its decoder alone.
fn pass_on(
    pad: &gst::Pad,
    pipeline: &gst::Pipeline,
    decode: &gst::Element,
) -> Result<(), Box<dyn std::error::Error>> {
    pipeline.add(decode)?;
    decode.sync_state_with_parent()?;
    pad.link(&decode.static_pad("sink").ok_or("a decoder without a sink pad")?)?;
    Ok(())
}

/// Builds what stands between a parsed stream and its two readers.
fn split(
    pad: &gst::Pad,
    stream: &gst::StructureRef,
    pipeline: &gst::Pipeline,
    (decode, queue): (&gst::Element, &Arc<EncodedQueue>),
) -> Result<(), Box<dyn std::error::Error>> {
    let tee = gst::ElementFactory::make("tee").build()?;
    let sink = make_sink(Some(queue), None, (&Arc::default(), &Arc::default()));
    let mut chain = packaging(stream)?;
    chain.push(tee);
    pipeline.add_many(&chain)?;
    pipeline.add_many([decode, sink.upcast_ref()])?;
    gst::Element::link_many(&chain)?;
    let tee = &chain[chain.len() - 1];
    number_buffers(&tee.static_pad("sink").ok_or("an element has no sink pad")?);
    // The decoder comes second: a picture that is taken finds its encoded frame in the queue.
    tee.link(&sink)?;
    tee.link(decode)?;
    sink.sync_state_with_parent()?;
    decode.sync_state_with_parent()?;
    for element in chain.iter().rev() {
        element.sync_state_with_parent()?;
    }
    let first = chain[0].static_pad("sink").ok_or("an element has no sink pad")?;
    pad.link(&first)?;
    Ok(())
}

/// Makes the elements that bring a codec's frames into the packaging that containers hold: whole pictures, the codec's header beside them.
/// Nothing where they came from a container so: parsed once more, those of a file with broken times would be lost.
fn packaging(stream: &gst::StructureRef) -> Result<Vec<gst::Element>, glib::BoolError> {
    let (parser, packaging) = match stream.name().as_str() {
        "video/x-h264" => ("h264parse", "avc"),
        "video/x-h265" => ("h265parse", "hvc1"),
        _ => return Ok(Vec::new()),
    };
    if stream.has_field("codec_data") && stream.get::<&str>("stream-format") == Ok(packaging) {
        return Ok(Vec::new());
    }
    let caps =
        gst::Caps::builder(stream.name()).field("stream-format", packaging).field("alignment", "au").build();
    let filter = gst::ElementFactory::make("capsfilter").property("caps", caps).build()?;
    Ok(vec![gst::ElementFactory::make(parser).build()?, filter])
}

/// Makes the end of a stream of encoded frames: each goes to the queue and to `also`, where they are. Behind the last one `has_ended`
/// is set. Frames without a part of a picture are left out, and counted where the picture was lost.
fn make_sink(
    queue: Option<&Arc<EncodedQueue>>,
    also: Option<FrameHandler>,
    (has_ended, n_damaged): (&Arc<AtomicBool>, &Arc<AtomicU64>),
) -> gst_app::AppSink {
    let sink = gst_app::AppSink::builder().sync(false).async_(false).enable_last_sample(false).build();
    if let (Some(pad), Some(queue)) = (sink.static_pad("sink"), queue.cloned()) {
        // A recording does not hold that a stream's pictures are turned.
        pad.add_probe(gst::PadProbeType::EVENT_DOWNSTREAM, move |_pad, info| {
            if info.event().is_some_and(|event| turns_pictures(event)) {
                queue.want_pictures();
            }
            gst::PadProbeReturn::Ok
        });
    }
    let (queue, n_damaged) = (queue.cloned(), Arc::clone(n_damaged));
    let was_lost = AtomicBool::new(false);
    // The format changes rarely, if ever, and all frames of one share it.
    let format: Mutex<Option<Arc<EncodedFormat>>> = Mutex::default();
    let take = move |sink: &gst_app::AppSink| {
        let mut sample = sink.pull_sample().map_err(|_ended: glib::BoolError| gst::FlowError::Eos)?;
        let content = content_of(&sample);
        if content != Content::Picture {
            if content == Content::Nothing {
                n_damaged.fetch_add(1, Ordering::Relaxed);
                if let Some(queue) = &queue {
                    queue.drop_elsewhere(1);
                }
            }
            was_lost.fetch_or(content == Content::Nothing || is_marked(&sample), Ordering::Relaxed);
            return Ok(gst::FlowSuccess::Ok);
        }
        if was_lost.swap(false, Ordering::Relaxed) {
            // A decoder learns of the loss by the frame behind it.
            mark(&mut sample);
        }
        // First, so that a picture that is taken finds its encoded frame in the queue.
        if let Some(queue) = queue.as_ref().filter(|queue| !queue.wants_pictures()) {
            record(queue, &sample, &format);
        }
        if let Some(also) = &also {
            also(&sample);
        }
        Ok(gst::FlowSuccess::Ok)
    };
    let has_ended = Arc::clone(has_ended);
    let end = move |_sink: &gst_app::AppSink| has_ended.store(true, Ordering::Release);
    sink.set_callbacks(gst_app::AppSinkCallbacks::builder().new_sample(take).eos(end).build());
    sink
}

/// Returns the content of a frame: of those without a picture the picture was lost, or they hold headers of the codec alone. A parser
/// takes both for key frames.
fn content_of(sample: &gst::SampleRef) -> Content {
    let format = sample.caps().and_then(|caps| caps.structure(0));
    let bytes = sample.buffer().and_then(|buffer| buffer.map_readable().ok());
    format.zip(bytes).map_or(Content::Picture, |(format, bytes)| nal_content(format, &bytes))
}

/// Returns true for a frame before which something was lost.
fn is_marked(sample: &gst::SampleRef) -> bool {
    sample.buffer().is_some_and(|buffer| buffer.flags().contains(gst::BufferFlags::DISCONT))
}

/// Marks a frame as one before which something was lost.
fn mark(sample: &mut gst::Sample) {
    let Some(mut buffer) = sample.buffer_owned() else { return };
    buffer.make_mut().set_flags(gst::BufferFlags::DISCONT);
    sample.make_mut().set_buffer(Some(&buffer));
}

fn record(queue: &EncodedQueue, sample: &gst::Sample, format: &Mutex<Option<Arc<EncodedFormat>>>) {
    let Some(caps) = sample.caps_owned() else { return };
    let mut format = lock(format);
    let known = format.take().filter(|known| *known.caps() == caps);
    let known = format.insert(known.unwrap_or_else(|| Arc::new(EncodedFormat::new(caps))));
    if let Some(frame) = EncodedFrame::of(sample, Arc::clone(known), Times::Played) {
        queue.push(frame);
    }
}
