//! Bounds what is gathered in the daemon of a camera's frame that never ends.
//!
//! Elements that join packets or parse a stream keep what they have until a frame is whole, however much that is.

use super::Fault;
use super::linking::report;
use super::pipeline::Parts;
use super::probes::take_away;
use gst::prelude::*;
use gstreamer as gst;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;

/// Most bytes of one encoded frame. A key frame of 36 megapixels at the best quality of usual cameras takes less.
const MAX_FRAME_BYTES: u64 = 16 << 20;

/// Most bytes before the first frame of H.264 and H.265: what joins packets drops those before the codec's header, which some cameras send
/// with their key frames alone, tens of seconds apart.
const MAX_BYTES_BEFORE: u64 = 32 << 20;

/// Bytes that an element has been given since it last gave something.
#[derive(Clone, Debug)]
struct Held {
    n_bytes: Arc<AtomicU64>,
    /// The most that it may have until it gives something for the first time.
    max_before_bytes: u64,
    has_begun: Arc<AtomicBool>,
}

impl Held {
    /// Begins to count, of an element that may have so many bytes until it gives something.
    fn new(max_before_bytes: u64) -> Self {
        Self { n_bytes: Arc::default(), max_before_bytes, has_begun: Arc::default() }
    }

    /// Counts what comes in at `entry`, reports the first frame that is too large, and lets nothing further of that stream in.
    fn count_in(&self, entry: &gst::Pad, faults: &SyncSender<Fault>) {
        let (held, faults) = (self.clone(), faults.clone());
        entry.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST, move |_, info| {
            let n_listed = || info.buffer_list().map_or(0, |list| list.calculate_size());
            let n_bytes = info.buffer().map_or_else(n_listed, |buffer| buffer.size());
            let n_bytes = u64::try_from(n_bytes).unwrap_or(u64::MAX);
            let n_held = held.n_bytes.fetch_add(n_bytes, Ordering::Relaxed).saturating_add(n_bytes);
            let has_begun = held.has_begun.load(Ordering::Relaxed);
            let limit = if has_begun { MAX_FRAME_BYTES } else { held.max_before_bytes };
            if n_held <= limit {
                return gst::PadProbeReturn::Ok;
            }
            let limit = limit >> 20;
            let reason = if has_begun { "one of its frames has" } else { "its first frame comes after" };
            report(&faults, Fault::Damaged(format!("{reason} more than {limit} MiB, or does not end")));
            take_away(info)
        });
    }

    /// Begins anew with everything that goes out at `exit`.
    fn clear_at(&self, exit: &gst::Pad) {
        let held = self.clone();
        exit.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST, move |_, _| {
            held.n_bytes.store(0, Ordering::Relaxed);
            held.has_begun.store(true, Ordering::Relaxed);
            gst::PadProbeReturn::Ok
        });
    }
}

/// Bounds what elements of `reader` that join packets gather, and from its first frame on what all of them do.
pub(super) fn bound(reader: &gst::Element, parts: &Parts<'_>) {
    let Some(bin) = reader.downcast_ref::<gst::Bin>() else { return };
    let faults = parts.faults.clone();
    bin.connect_deep_element_added(move |_bin, _within, element| {
        if !joins_packets(element) {
            return;
        }
        if let (Some(entry), Some(exit)) = (element.static_pad("sink"), element.static_pad("src")) {
            let held = Held::new(max_before_bytes(element));
            held.count_in(&entry, &faults);
            held.clear_at(&exit);
        }
    });
    // Before the first frame a parser may wait for long for one that a decoder can begin with, and drops the others.
    let (entry, faults) = (reader.static_pad("sink"), parts.faults.clone());
    reader.connect_pad_added(move |_reader, exit| {
        let is_encoded = exit.current_caps().unwrap_or_else(|| exit.query_caps(None));
        let is_encoded = is_encoded.structure(0).is_some_and(|kind| kind.name() != "video/x-raw");
        if let Some(entry) = entry.as_ref().filter(|_| is_encoded) {
            let held = Held::new(MAX_FRAME_BYTES);
            held.count_in(entry, &faults);
            held.clear_at(exit);
        }
    });
}

/// Returns the most bytes that an element which joins packets may have until it gives something.
fn max_before_bytes(element: &gst::Element) -> u64 {
    let waits = |name: &str| matches!(name, "rtph264depay" | "rtph265depay");
    let waits = element.factory().is_some_and(|factory| waits(&factory.name()));
    if waits { MAX_BYTES_BEFORE } else { MAX_FRAME_BYTES }
}

/// Tells an element that joins packets of encoded frames. That of unencoded ones has memory for one picture, whose size is looked at.
fn joins_packets(element: &gst::Element) -> bool {
    element.factory().is_some_and(|factory| {
        factory.name() != "rtpvrawdepay"
            && factory.metadata("klass").is_some_and(|class| class.contains("Depayloader"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gstreamer_app as gst_app;
    use std::sync::mpsc::sync_channel;

    /// The header of a stream of 640 x 480.
    const SPROP: &str = "Z0LAHtkDxWhAAAADAEAAAAwDxYuS,aMuMsg==";

    /// Bytes of one packet's payload.
    const PAYLOAD_BYTES: usize = 60_000;

    /// Sends 40 MiB to a joiner of H.264 packets, whose first bytes are `begin` in the first packet and `next` in the others; the reasons
    /// that are reported.
    fn faults_of(begin: &[u8], next: &[u8]) -> Vec<String> {
        gst::init().unwrap();
        let caps = "application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=96";
        let caps = format!("{caps},sprop-parameter-sets=(string)\\\"{SPROP}\\\"");
        let line = format!(
            "appsrc name=source format=time caps={caps} ! rtph264depay name=joiner ! fakesink async=false"
        );
        let pipeline = gst::parse::launch(&line).unwrap().downcast::<gst::Pipeline>().unwrap();
        let joiner = pipeline.by_name("joiner").unwrap();
        assert!(joins_packets(&joiner));
        let (faults, reported) = sync_channel(8);
        let held = Held::new(max_before_bytes(&joiner));
        held.count_in(&joiner.static_pad("sink").unwrap(), &faults);
        held.clear_at(&joiner.static_pad("src").unwrap());
        let source = pipeline.by_name("source").unwrap().downcast::<gst_app::AppSrc>().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        for number in 0..(40 << 20) / PAYLOAD_BYTES as u32 {
            // The mark of a frame's last packet.
            let mut packet = vec![0x80, 0x80 | 96];
            packet.extend((number as u16).to_be_bytes());
            packet.extend((number * 3000).to_be_bytes());
            packet.extend([0, 0, 0, 1]);
            packet.extend(if number == 0 { begin } else { next });
            packet.resize(packet.len() + PAYLOAD_BYTES, 7);
            source.push_buffer(gst::Buffer::from_mut_slice(packet)).unwrap();
        }
        source.end_of_stream().unwrap();
        let bus = pipeline.bus().unwrap();
        bus.timed_pop_filtered(gst::ClockTime::from_seconds(20), &[gst::MessageType::Eos]).expect("its end");
        pipeline.set_state(gst::State::Null).unwrap();
        reported.try_iter().map(|fault| fault.to_string()).collect()
    }

    /// The daemon's memory rose by as much as such a camera sent.
    #[test]
    fn a_frame_that_never_ends_is_reported_and_let_in_no_further() {
        // FU-A, first and following ones, and none with the bit of the last.
        let reasons = faults_of(&[0x7c, 0x85], &[0x7c, 0x05]);
        assert_eq!(reasons[0], "its first frame comes after more than 32 MiB, or does not end");
        assert!(reasons.len() > 1, "what follows is not let in either: {reasons:?}");
    }

    #[test]
    fn frames_that_end_may_be_as_many_as_they_are() {
        // Whole slices.
        assert!(faults_of(&[0x65], &[0x41]).is_empty());
    }
}
