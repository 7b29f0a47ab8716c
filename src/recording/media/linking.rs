//! Links a reader's streams as they appear, and decides what may read them.

use super::allowed::is_allowed;
use super::announced::{is_too_large, size_of_format};
use super::fault::{Fault, gstreamer_fault};
use super::input::Keep;
use super::pipeline::Parts;
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use gstreamer_video as gst_video;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;

/// Links the first stream of `reader` whose media type is wanted, by `link`, as soon as it is there. A reader that has none is at
/// fault.
pub(super) fn link_first(
    reader: &gst::Element,
    parts: &Parts<'_>,
    is_wanted: fn(&str) -> bool,
    link: impl Fn(&gst::Pad, &gst::Caps, &gst::Pipeline) -> Result<(), Fault> + Send + Sync + 'static,
) {
    let is_linked = Arc::new(AtomicBool::new(false));
    let (was_linked, no_video) = (Arc::clone(&is_linked), parts.faults.clone());
    reader.connect_no_more_pads(move |_reader| {
        if !was_linked.load(Ordering::Acquire) {
            report(&no_video, Fault::NotVideo("it has no video stream".to_owned()));
        }
    });
    let (pipeline, faults) = (parts.pipeline.downgrade(), parts.faults.clone());
    reader.connect_pad_added(move |_reader, pad| {
        let Some(pipeline) = pipeline.upgrade() else { return };
        let caps = pad.current_caps().unwrap_or_else(|| pad.query_caps(None));
        let is_wanted = caps.structure(0).is_some_and(|structure| is_wanted(structure.name()));
        if !is_wanted || is_linked.swap(true, Ordering::AcqRel) {
            return;
        }
        if let Err(fault) = link(pad, &caps, &pipeline) {
            report(&faults, fault);
        }
    });
}

/// Links the first video that `decode` gives to the pipeline's sink.
pub(super) fn link_first_video(decode: &gst::Element, parts: &Parts<'_>) {
    let (sink, keep) = (parts.sink.downgrade(), parts.keep);
    link_first(
        decode,
        parts,
        |kind| kind == "video/x-raw",
        move |pad, caps, pipeline| {
            let Some(sink) = sink.upgrade() else { return Ok(()) };
            link_video(pad, caps, pipeline, (&sink, keep))
        },
    );
}

/// Reports a fault. One is enough: while the channel is full, the one in it counts.
pub(super) fn report(faults: &SyncSender<Fault>, fault: Fault) {
    if let Err(error) = faults.try_send(fault) {
        tracing::debug!(%error, "a second fault of one stream is left out");
    }
}

/// Links a pad that gives unencoded video to the sink, through a converter where it has another form.
pub(super) fn link_video(
    pad: &gst::Pad,
    caps: &gst::Caps,
    pipeline: &gst::Pipeline,
    (sink, keep): (&gst_app::AppSink, Keep),
) -> Result<(), Fault> {
    let structure =
        caps.structure(0).ok_or_else(|| Fault::NotVideo("a stream without a format".to_owned()))?;
    if let Some((width, height)) = size_of_format(structure).filter(|size| is_too_large(*size)) {
        return Err(Fault::TooLarge { width, height });
    }
    let fails = |error: glib::BoolError| gstreamer_fault("convert the decoder's pictures", &error);
    let mut end: gst::Element = sink.clone().upcast();
    if keep == Keep::All {
        // Lets everything through untouched unless the file says that its pictures are turned, which it does later.
        end = put_before("videoflip", &end, pipeline).map_err(fails)?;
        end.set_property_from_str("video-direction", "auto");
    }
    end = put_square_pixels_before(&end, pipeline).map_err(fails)?;
    if structure.get::<&str>("format") != Ok("I420") {
        end = add_converter(pipeline, &end, structure).map_err(fails)?;
    }
    let target = end.static_pad("sink");
    let target = target.ok_or_else(|| Fault::Gstreamer {
        action: "link the decoder".into(),
        detail: "an element has no sink pad".to_owned(),
    })?;
    pad.link(&target).map(|_linked| ()).map_err(|error| gstreamer_fault("link the decoder", &error))
}

/// Returns whether an event says that pictures are to be turned or mirrored before they are shown, as telephones' are.
pub(super) fn turns_pictures(event: &gst::EventRef) -> bool {
    let gst::EventView::Tag(event) = event.view() else { return false };
    event
        .tag()
        .get::<gst::tags::ImageOrientation>()
        .is_some_and(|orientation| orientation.get() != "rotate-0")
}

/// Puts a scaler in front of `next` that makes pixels square: pictures of another shape are stretched along the side that grows, so
/// that no detail is lost, and others go through untouched. Neither the shape nor the size of a stream's pixels has to stay.
fn put_square_pixels_before(
    next: &gst::Element,
    pipeline: &gst::Pipeline,
) -> Result<gst::Element, glib::BoolError> {
    let filter = put_before("capsfilter", next, pipeline)?;
    let scale = put_before("videoscale", &filter, pipeline)?;
    if let Some(pad) = scale.static_pad("sink") {
        pad.add_probe(gst::PadProbeType::EVENT_DOWNSTREAM, move |_pad, info| {
            let Some(event) = info.event() else { return gst::PadProbeReturn::Ok };
            let gst::EventView::Caps(event) = event.view() else { return gst::PadProbeReturn::Ok };
            let size = event.caps().structure(0).and_then(|format| {
                let shape = format.get::<gst::Fraction>("pixel-aspect-ratio").ok()?;
                square_size(size_of_format(format)?, (shape.numer(), shape.denom()))
            });
            let caps = size.map_or_else(gst::Caps::new_any, |(width, height)| {
                let caps =
                    gst::Caps::builder("video/x-raw").field("pixel-aspect-ratio", gst::Fraction::new(1, 1));
                caps.field("width", width as i32).field("height", height as i32).build()
            });
            filter.set_property("caps", caps);
            gst::PadProbeReturn::Ok
        });
    }
    Ok(scale)
}

/// Returns the size, in pixels, of a picture of `size` pixels each `shape.0 / shape.1` times as wide as high (the sample aspect
/// ratio) once its pixels are square; nothing where they are so already, to the hundredth, and where the ratio is none that cameras
/// send: beyond 4 or a fourth, or such that the picture would be larger than any may be.
fn square_size((width, height): (u32, u32), shape: (i32, i32)) -> Option<(u32, u32)> {
    let ratio = f64::from(shape.0) / f64::from(shape.1);
    let is_stretched = (0.25..=4.0).contains(&ratio) && (ratio.max(1.0 / ratio) > 1.01);
    let longer = |side: u32, ratio: f64| (f64::from(side) * ratio).round() as u32;
    let size =
        if ratio > 1.0 { (longer(width, ratio), height) } else { (width, longer(height, 1.0 / ratio)) };
    (is_stretched && !is_too_large(size)).then_some(size)
}

/// Puts a new element in front of `next`.
fn put_before(
    name: &'static str,
    next: &gst::Element,
    pipeline: &gst::Pipeline,
) -> Result<gst::Element, glib::BoolError> {
    let element = gst::ElementFactory::make(name).build()?;
    pipeline.add(&element)?;
    element.link(next)?;
    element.sync_state_with_parent()?;
    Ok(element)
}

/// A converter to I420 in front of `next`. The colours keep the code that the decoder gave them, so that no
/// range is squeezed.
fn add_converter(
    pipeline: &gst::Pipeline,
    next: &gst::Element,
    from: &gst::StructureRef,
) -> Result<gst::Element, glib::BoolError> {
    let has_luma = from
        .get::<&str>("format")
        .ok()
        .and_then(|name| name.parse::<gst_video::VideoFormat>().ok())
        .map(gst_video::VideoFormatInfo::from_format)
        .is_some_and(|format| format.is_yuv() || format.is_gray());
    let colorimetry = from.get::<&str>("colorimetry").ok().filter(|_| has_luma);
    let to = gst::Caps::builder("video/x-raw").field("format", "I420");
    let to = to.field_if_some("colorimetry", colorimetry).build();
    let filter = put_before("capsfilter", next, pipeline)?;
    filter.set_property("caps", to);
    put_before("videoconvert", &filter, pipeline)
}

/// Leaves sound and text as they are (what is not needed is neither decoded nor missed), has nothing read by an element that
/// is not allowed, and collects the formats of streams that nothing reads.
pub(super) fn watch(reader: &gst::Element, parts: &Parts<'_>) {
    let keep = parts.keep;
    reader.connect("autoplug-continue", false, |values| {
        let caps = values.get(2).and_then(|value| value.get::<gst::Caps>().ok());
        let is_beside =
            caps.is_some_and(|caps| caps.structure(0).is_some_and(|kind| is_beside_video(kind.name())));
        Some((!is_beside).to_value())
    });
    reader.connect("autoplug-select", false, move |values| {
        let caps = values.get(2).and_then(|value| value.get::<gst::Caps>().ok());
        let factory = values.get(3).and_then(|value| value.get::<gst::ElementFactory>().ok());
        let is_skipped = caps
            .zip(factory)
            .is_none_or(|(caps, factory)| !is_allowed(&factory, keep) || loses_frames(&factory, &caps));
        let kind = glib::Type::from_name("GstAutoplugSelectResult")?;
        glib::EnumClass::with_type(kind)?.to_value_by_nick(if is_skipped { "skip" } else { "try" })
    });
    let unknown = parts.unknown_streams.clone();
    reader.connect("unknown-type", false, move |values| {
        if let Some(Ok(caps)) = values.get(2).map(glib::Value::get::<gst::Caps>)
            && unknown.try_send(caps).is_err()
        {
            tracing::debug!("more unknown streams than are told of");
        }
        None
    });
}

/// Returns true where an element parses again what a container has parted into frames already (seen with 1.22): that of MPEG-4
/// (part 2) joins or loses frames at the stream's ends, those of H.264 and H.265 lose nearly all of a file with broken
/// times. A bare stream has neither a size nor the codec's header before it was parsed, and a container that does not say that
/// its frames are whole (FLV) has none that a decoder takes as they are.
fn loses_frames(factory: &gst::ElementFactory, caps: &gst::Caps) -> bool {
    let has = |field| caps.structure(0).is_some_and(|structure| structure.has_field(field));
    match factory.name().as_str() {
        "mpeg4videoparse" => has("width"),
        "h264parse" | "h265parse" => has("codec_data") && has("alignment"),
        _ => false,
    }
}

fn is_beside_video(kind: &str) -> bool {
    ["audio/", "text/", "subpicture/", "closedcaption/"].iter().any(|prefix| kind.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::square_size;

    #[test]
    fn pixels_become_square_along_the_side_that_grows() {
        let cases = [
            ((720, 576), (16, 15), Some((768, 576))),
            ((720, 576), (64, 45), Some((1024, 576))),
            ((720, 480), (8, 9), Some((720, 540))),
            ((352, 288), (12, 11), Some((384, 288))),
            ((640, 480), (1, 1), None),
            // Encoders round so.
            ((1920, 1080), (135, 136), None),
            ((4096, 4096), (4, 1), None),
            ((8192, 64), (2, 1), None),
            ((640, 480), (1000, 1), None),
            ((640, 480), (1, 5), None),
            ((640, 480), (0, 1), None),
            ((640, 480), (1, 0), None),
            ((640, 480), (0, 0), None),
            ((640, 480), (-4, 3), None),
            ((640, 480), (i32::MAX, i32::MIN), None),
        ];
        for (size, shape, expected) in cases {
            assert_eq!(square_size(size, shape), expected, "{size:?} {shape:?}");
        }
    }
}
