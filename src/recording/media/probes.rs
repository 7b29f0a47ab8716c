//! Probes at decoders' inputs, which keep from them what would harm: broken frames, and pictures beyond the limits.

use super::announced::{self, Announced, is_too_large, size_of_format};
use super::fault::Fault;
use super::jpeg;
use super::linking::report;
use super::losses::Losses;
use super::pipeline::{is_decoder, is_picture_decoder};
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, PoisonError};

/// Frames with headers that cannot be read, of which a stream may begin with so many; one that has nothing else gives no picture.
const MAX_UNREADABLE: u64 = 50;

/// The one reader of a container that makes pictures by itself.
const READER_OF_YUV4MPEG: &str = "y4mdec";

/// The size, in bytes, up to which a buffer may be a placeholder for a frame.
const LARGEST_PLACEHOLDER_BYTES: usize = 16;

/// Counts the frames that go into a pipeline's first decoder of pictures and are to be seen.
pub(super) fn count_entries(element: &gst::Element, n_entered: &Arc<AtomicU64>) {
    // The pipeline and who asks it hold one each; the probe of one that counts already is a third.
    let is_first = || Arc::strong_count(n_entered) <= 2;
    let Some(pad) = element.static_pad("sink").filter(|_| is_picture_decoder(element) && is_first()) else {
        return;
    };
    let n_entered = Arc::clone(n_entered);
    pad.add_probe(gst::PadProbeType::BUFFER, move |pad, info| {
        let is_seen = |buffer: &gst::Buffer| {
            let is_small_frame = || {
                let caps = pad.current_caps();
                let kind = caps.as_ref().and_then(|caps| caps.structure(0)).map(gst::StructureRef::name);
                let kind = kind.map_or("", |kind| kind.as_str());
                buffer.map_readable().is_ok_and(|bytes| !is_placeholder(kind, &bytes))
            };
            !buffer.flags().contains(gst::BufferFlags::DECODE_ONLY)
                && (buffer.size() > LARGEST_PLACEHOLDER_BYTES || is_small_frame())
        };
        if info.buffer().is_some_and(is_seen) {
            n_entered.fetch_add(1, Ordering::Relaxed);
        }
        gst::PadProbeReturn::Ok
    });
}

/// Returns true for a small buffer that stands in a file of this `kind` of video where there is no frame: an empty one for a
/// dropped frame, or the byte that follows two MPEG-4 frames packed into one buffer (`DivX` and Xvid write AVI files so).
fn is_placeholder(kind: &str, bytes: &[u8]) -> bool {
    let has_start_code = || bytes.windows(3).any(|window| window == [0, 0, 1]);
    bytes.is_empty() || (matches!(kind, "video/mpeg" | "video/x-divx" | "video/x-xvid") && !has_start_code())
}

/// Lets the decoder of a live input leave out what it cannot decode, however much that is, and keeps from it broken JPEG
/// and, once packets were lost, all that builds on what they held: a decoder would make smears of it that look like
/// something that moves.
pub(super) fn be_patient(element: &gst::Element, n_damaged: &Arc<AtomicU64>) {
    if !is_decoder(element.upcast_ref()) {
        return;
    }
    let has_limit = element.find_property("max-errors").map(|property| property.value_type());
    if has_limit == Some(glib::Type::I32) {
        element.set_property("max-errors", -1_i32);
    }
    let n_damaged = Arc::clone(n_damaged);
    let losses = Mutex::new(Losses::default());
    let Some(pad) = element.static_pad("sink") else { return };
    pad.add_probe(gst::PadProbeType::BUFFER, move |pad, info| {
        let caps = pad.current_caps();
        let kind = caps.as_ref().and_then(|caps| caps.structure(0)).map(gst::StructureRef::name);
        let Some(buffer) = info.buffer() else { return gst::PadProbeReturn::Ok };
        let is_good = if kind.is_some_and(|kind| kind == "image/jpeg") {
            buffer.map_readable().is_ok_and(|bytes| jpeg::is_whole(&bytes))
        } else {
            losses
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .is_good(buffer.flags(), gst::get_timestamp())
        };
        if is_good {
            return gst::PadProbeReturn::Ok;
        }
        n_damaged.fetch_add(1, Ordering::Relaxed);
        take_away(info)
    });
}

/// Takes a probe's buffer or list of them, so that whoever it was for never sees it. `GStreamer` 1.22 complains where it is told to drop it,
/// or that it was refused.
pub(super) fn take_away(info: &mut gst::PadProbeInfo<'_>) -> gst::PadProbeReturn {
    drop(info.data.take());
    info.flow_res = Ok(gst::FlowSuccess::Ok);
    gst::PadProbeReturn::Handled
}

/// Tells of pictures beyond the limits where they reach a parser, or the reader of YUV4MPEG, since these refuse the largest without a word
/// of their size.
pub(super) fn tell_large_pictures(element: &gst::Element, faults: &SyncSender<Fault>) {
    let is_reader = element.factory().is_some_and(|factory| {
        factory.has_type(gst::ElementFactoryType::PARSER) || factory.name() == READER_OF_YUV4MPEG
    });
    let Some(pad) = element.static_pad("sink").filter(|_| is_reader) else { return };
    let faults = faults.clone();
    pad.add_probe(gst::PadProbeType::BUFFER, move |pad, info| {
        // What reads by itself, instead of being given bytes, is not told their format.
        let caps = pad.current_caps().unwrap_or_else(|| pad.pad_template_caps());
        let format = caps.structure(0);
        let bytes = info.buffer().and_then(|buffer| buffer.map_readable().ok());
        if let (Some(format), Some(bytes)) = (format, bytes)
            && let Announced::Size((width, height)) = announced::before_parser(format, &bytes)
            && is_too_large((width, height))
        {
            report(&faults, Fault::TooLarge { width, height });
        }
        gst::PadProbeReturn::Ok
    });
}

/// Keeps from a decoder what announces pictures beyond the limits, which ends the stream, and headers that cannot be read.
pub(super) fn refuse_large_pictures(element: &gst::Element, faults: &SyncSender<Fault>) {
    if !is_decoder(element.upcast_ref()) {
        return;
    }
    let Some(pad) = element.static_pad("sink") else { return };
    let kinds = gst::PadProbeType::BUFFER | gst::PadProbeType::EVENT_DOWNSTREAM;
    let (faults, is_over, is_unreadable) = (faults.clone(), AtomicBool::new(false), AtomicBool::new(false));
    let (has_read, n_unreadable) = (AtomicBool::new(false), AtomicU64::new(0));
    pad.add_probe(kinds, move |pad, info| {
        let (announced, is_format) = match &info.data {
            Some(gst::PadProbeData::Event(event)) => match event.view() {
                gst::EventView::Caps(event) => {
                    let said = event.caps().structure(0).map_or(Announced::Nothing, |format| {
                        let named = size_of_format(format).map_or(Announced::Nothing, Announced::Size);
                        named.max(announced::in_format(format))
                    });
                    (said, true)
                }
                _ => return gst::PadProbeReturn::Ok,
            },
            Some(gst::PadProbeData::Buffer(buffer)) => {
                let caps = pad.current_caps();
                let format = caps.as_ref().and_then(|caps| caps.structure(0));
                match (format, buffer.map_readable()) {
                    (Some(format), Ok(bytes)) => (announced::in_bytes(format, &bytes), false),
                    _ => (Announced::Unreadable, false),
                }
            }
            _ => return gst::PadProbeReturn::Ok,
        };
        if let Announced::Size((width, height)) = announced
            && is_too_large((width, height))
        {
            is_over.store(true, Ordering::Relaxed);
            report(&faults, Fault::TooLarge { width, height });
        }
        if is_format {
            // It goes on, since nothing is allocated before the first buffer; that does not.
            is_unreadable.store(announced == Announced::Unreadable, Ordering::Relaxed);
            if announced == Announced::Unreadable {
                report(&faults, Fault::Damaged("the header of its codec cannot be read".to_owned()));
            }
            return gst::PadProbeReturn::Ok;
        }
        if announced != Announced::Unreadable {
            has_read.store(true, Ordering::Relaxed);
        } else if !has_read.load(Ordering::Relaxed)
            && n_unreadable.fetch_add(1, Ordering::Relaxed) == MAX_UNREADABLE
        {
            report(&faults, Fault::Damaged("the headers of its frames cannot be read".to_owned()));
        }
        let is_kept = announced == Announced::Unreadable
            || is_over.load(Ordering::Relaxed)
            || is_unreadable.load(Ordering::Relaxed);
        if is_kept { take_away(info) } else { gst::PadProbeReturn::Ok }
    });
}

#[cfg(test)]
mod tests {
    use super::is_placeholder;

    #[test]
    fn placeholders_of_files_are_told_from_small_frames() {
        let not_coded = [0, 0, 1, 0xb6, 0x50, 0x7f];
        assert!(is_placeholder("video/x-divx", &[0x7f]) && is_placeholder("video/mpeg", &[0; 8]));
        assert!(!is_placeholder("video/mpeg", &not_coded), "a repeated frame of MPEG-4");
        assert!(!is_placeholder("video/x-vp9", &[0x80]), "a frame that is shown again");
        assert!(is_placeholder("video/x-vp8", &[]));
    }
}
