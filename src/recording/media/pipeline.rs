//! One `GStreamer` pipeline from a source to I420 pictures, or to encoded frames, and what its messages mean.
//!
//! In a worker `source ! decodebin ! [videoconvert !] appsink`; in the daemon, of a camera, `source ! parsebin ! appsink`,
//! whose frames a worker decodes (`tap`). Decodebin finds demuxer and decoder, and works without the
//! parsers of plugins-bad. Only the first video stream is decoded. The decoder's own buffers arrive: where it
//! writes I420 there is no converter, and the sink accepts padded rows (`VideoMeta`), so nothing is copied. Where the
//! encoded frames are wanted too, `tap` splits the stream before decodebin.

use super::allowed::is_refused;
use super::device::device_fault;
use super::fault::{ConnectionFault, gstreamer_fault, missing_codec, refused_format};
use super::input::{Client, Connection, Keep, Memory, Source, make};
use super::linking::{link_first_video, watch};
use super::probes::{be_patient, count_entries, refuse_large_pictures, tell_large_pictures};
use super::sink::{count_arrivals, free_with_the_last_user, make_sink};
use super::{EncodedQueue, Fault, tap, unfinished};
use gst::glib;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::fs::File;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

/// Text of the errors by which elements say that they do not go on, and nothing of why.
const UNNAMED_ERROR: &str = "Internal data stream error";

/// Most threads of one decoder: many cameras decode side by side.
const MAX_DECODER_THREADS: usize = 2;

/// A running pipeline; it ends when this is dropped.
#[derive(Debug)]
pub(super) struct Pipeline {
    pipeline: gst::Pipeline,
    bus: gst::Bus,
    sink: gst_app::AppSink,
    link_faults: Receiver<Fault>,
    unknown_streams: Receiver<gst::Caps>,
    n_arrived: Arc<AtomicU64>,
    n_pulled: AtomicU64,
    n_damaged: Arc<AtomicU64>,
    /// Frames of a file that went into its decoder.
    n_entered: Arc<AtomicU64>,
    keep: Keep,
    /// True once the last of a camera's frames was handed over.
    has_handed_over_all: Arc<AtomicBool>,
    /// True where errors may name addresses and passwords: of a camera that is connected to from here.
    has_secrets: bool,
    /// The file that it reads, kept open.
    _file: Option<File>,
    /// The connection that feeds it, where it does not read by itself.
    connection: Option<Connection>,
}

/// Aim of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Aim {
    /// It decodes.
    Pictures,
    /// It hands over frames as they are encoded.
    Frames,
}

/// A pipeline that is built and does not run yet.
struct Built {
    pipeline: Pipeline,
    faults: SyncSender<Fault>,
}

impl Pipeline {
    /// Starts decoding what `source` gives. With `encoded`, the frames that the pictures are decoded from are put there as they
    /// come, each some pictures before its own.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element or cannot start; all else shows with the first picture.
    pub(super) fn start(source: Source, encoded: Option<&Arc<EncodedQueue>>) -> Result<Self, Fault> {
        let decode = make("decodebin")?;
        let built = Built::new(source, Aim::Pictures, |parts| {
            link_first_video(&decode, parts);
            watch(&decode, parts);
            let Some(queue) = encoded else { return Ok(decode.clone()) };
            let parse = make("parsebin")?;
            watch(&parse, parts);
            tap::split_first_video(&parse, &decode, parts, queue);
            Ok(parse)
        })?;
        built.run(None)
    }

    /// Starts handing over what a camera sends: encoded frames to `frames` and, where they are wanted and can be recorded, to
    /// `encoded`. Pictures that come unencoded are pulled here.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element or cannot start; all else shows with the first picture.
    pub(super) fn hand_over(
        (source, client): (Source, Option<Box<dyn Client>>),
        encoded: Option<&Arc<EncodedQueue>>,
        frames: tap::FrameHandler,
    ) -> Result<Self, Fault> {
        let built = Built::new(source, Aim::Frames, |parts| {
            let parse = make("parsebin")?;
            watch(&parse, parts);
            unfinished::bound(&parse, parts);
            tap::hand_over_first_video(&parse, parts, (encoded, frames));
            Ok(parse)
        })?;
        built.run(client)
    }

    /// Returns the next picture if one comes within `patience`. Of a live input, one that its decoder marks as broken is left out
    /// and counted.
    pub(super) fn pull(&self, patience: Duration) -> Option<gst::Sample> {
        let patience = gst::ClockTime::try_from(patience).unwrap_or(gst::ClockTime::ZERO);
        let sample = self.sink.try_pull_sample(patience)?;
        self.n_pulled.fetch_add(1, Ordering::Relaxed);
        let is_broken =
            sample.buffer().is_some_and(|buffer| buffer.flags().contains(gst::BufferFlags::CORRUPTED));
        if is_broken {
            self.n_damaged.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        Some(sample)
    }

    /// Returns the number of pictures that were left out as broken, and of complaints of a decoder, each of which cost a picture; of
    /// a file that has ended also of frames of which no picture came.
    pub(super) fn n_damaged(&self) -> u64 {
        let n_damaged = self.n_damaged.load(Ordering::Relaxed);
        if self.keep == Keep::Newest || !self.has_ended() {
            return n_damaged;
        }
        let n_entered = self.n_entered.load(Ordering::Relaxed);
        // A complaint cost the same picture.
        n_damaged.max(n_entered.saturating_sub(self.n_arrived.load(Ordering::Relaxed)))
    }

    /// Pictures of a live input that newer ones replaced before they were pulled; one that waits now may be counted.
    pub(super) fn n_replaced(&self) -> u64 {
        let n_pulled = self.n_pulled.load(Ordering::Relaxed);
        self.n_arrived.load(Ordering::Relaxed).saturating_sub(n_pulled + 1)
    }

    /// Returns the number of pictures that reached the sink.
    pub(super) fn n_arrived(&self) -> u64 {
        self.n_arrived.load(Ordering::Relaxed)
    }

    /// Returns true once every picture was pulled.
    pub(super) fn has_ended(&self) -> bool {
        self.sink.is_eos()
    }

    /// Returns true once a camera's connection has ended and the last of its frames was handed over.
    pub(super) fn has_handed_over_all(&self) -> bool {
        self.has_handed_over_all.load(Ordering::Acquire)
    }

    /// Returns true where nothing in the pipeline is at work, so that nothing will come. An error that a demuxer posts while
    /// decodebin still tries it is swallowed there (seen with 1.22 on a file that breaks off in its header): the
    /// demuxer then rests for ever, and this is its only trace.
    pub(super) fn is_idle(&self) -> bool {
        let mut elements = self.pipeline.iterate_recurse().into_iter().filter_map(Result::ok);
        let is_at_work = |pad: &gst::Pad| pad.task_state() == gst::TaskState::Started;
        !elements.any(|element| element.pads().iter().any(is_at_work))
    }

    /// Returns the length of the source in nanoseconds, where that is known.
    pub(super) fn duration_nanos(&self) -> Option<i64> {
        let duration = self.pipeline.query_duration::<gst::ClockTime>()?;
        i64::try_from(duration.nseconds()).ok().filter(|nanos| *nanos > 0)
    }

    /// Returns the codec of the pictures, such as `h264`, once one has come; none where they come unencoded.
    pub(super) fn codec(&self) -> Option<String> {
        let elements = self.pipeline.iterate_recurse().into_iter().filter_map(Result::ok);
        let decoders = elements.filter(|element| is_decoder(element.upcast_ref()));
        decoders
            .filter_map(|element| element.static_pad("sink")?.current_caps())
            .find_map(|caps| codec_of(&caps))
    }

    /// Goes on at the key frame before a time; whether the input takes that.
    pub(super) fn seek(&self, stream_nanos: i64) -> bool {
        let time = gst::ClockTime::from_nseconds(u64::try_from(stream_nanos).unwrap_or_default());
        let how = gst::SeekFlags::FLUSH | gst::SeekFlags::KEY_UNIT | gst::SeekFlags::SNAP_BEFORE;
        self.pipeline.seek_simple(how, time).is_ok()
    }

    /// Returns what went wrong since the last call, if anything did.
    pub(super) fn fault(&self) -> Option<Fault> {
        if let Ok(fault) = self.link_faults.try_recv() {
            return Some(if matches!(fault, Fault::NotVideo(_)) {
                self.unread_video().unwrap_or(fault)
            } else {
                fault
            });
        }
        let message = self.bus.pop_filtered(&[gst::MessageType::Error])?;
        let gst::MessageView::Error(message) = message.view() else { return None };
        let error = message.error();
        if self.has_secrets {
            return Some(self.live_fault(&error));
        }
        // The debug text holds line numbers and element names: for the log alone.
        tracing::debug!(%error, source = message.debug().as_deref().unwrap_or(""), "a pipeline failed");
        Some(self.error_fault(&error))
    }

    /// Returns the fault that an error on the bus means.
    fn error_fault(&self, error: &glib::Error) -> Fault {
        if let Some(fault) = self.unread_video() {
            return fault;
        }
        let detail = error.message().trim_end_matches('.');
        match error.kind::<gst::StreamError>() {
            Some(gst::StreamError::TypeNotFound | gst::StreamError::WrongType) => {
                Fault::NotVideo(detail.to_owned())
            }
            _ if detail == UNNAMED_ERROR => Fault::Damaged(
                "it breaks off: its container is damaged, or claims more than it holds".to_owned(),
            ),
            _ => Fault::Damaged(detail.to_owned()),
        }
    }

    /// Returns the fault that an error on the bus of a camera means: nothing of what the error says is told or logged, since it may hold a secret.
    fn live_fault(&self, error: &glib::Error) -> Fault {
        if let Some(fault) = self.unread_video() {
            return fault;
        }
        // Only a device is an element of the pipeline; other cameras' connections tell themselves.
        if let Some(kind) = error.kind::<gst::ResourceError>() {
            return Fault::Connection(device_fault(kind));
        }
        let (core, stream) = (error.kind::<gst::CoreError>(), error.kind::<gst::StreamError>());
        tracing::debug!(?core, ?stream, "a camera's pipeline failed");
        match stream {
            Some(gst::StreamError::TypeNotFound | gst::StreamError::WrongType) => {
                Fault::NotVideo("its type is not known".to_owned())
            }
            Some(gst::StreamError::Decrypt | gst::StreamError::DecryptNokey) => {
                Fault::Connection(ConnectionFault::Insecure)
            }
            _ => Fault::Damaged("its stream cannot be parted into frames".to_owned()),
        }
    }

    /// The missing codec, if a stream was found that nothing installed reads.
    pub(super) fn unread_video(&self) -> Option<Fault> {
        self.unknown_streams.try_iter().find_map(|caps| {
            let format = caps.structure(0)?;
            Some(if is_refused(format, self.keep) { refused_format(format) } else { missing_codec(format) })
        })
    }
}

/// Parts of a pipeline that a reader's callbacks have to do with.
pub(super) struct Parts<'a> {
    pub(super) pipeline: &'a gst::Pipeline,
    pub(super) sink: &'a gst_app::AppSink,
    pub(super) keep: Keep,
    pub(super) faults: &'a SyncSender<Fault>,
    pub(super) unknown_streams: &'a SyncSender<gst::Caps>,
    pub(super) has_handed_over_all: &'a Arc<AtomicBool>,
    pub(super) n_damaged: &'a Arc<AtomicU64>,
}

impl Built {
    /// Builds a pipeline from `source` to the reader that `make_reader` gives, and to a sink.
    fn new(
        source: Source,
        aim: Aim,
        make_reader: impl FnOnce(&Parts<'_>) -> Result<gst::Element, Fault>,
    ) -> Result<Self, Fault> {
        gst::init().map_err(|error| gstreamer_fault("start", &error))?;
        let (keep, hands_over) = (source.keep, aim == Aim::Frames);
        let sink = make_sink(keep, source.allocator.as_ref());
        if source.memory == Memory::Own {
            free_with_the_last_user(&sink);
        }
        let n_arrived = count_arrivals(&sink);
        let pipeline = gst::Pipeline::new();
        pipeline.add(&sink).map_err(|error| gstreamer_fault("build a pipeline", &error))?;
        let n_damaged = Arc::<AtomicU64>::default();
        let n_entered = Arc::<AtomicU64>::default();
        let (counter, entries) = (Arc::clone(&n_damaged), Arc::clone(&n_entered));
        let (faults, link_faults) = sync_channel(1);
        let size_faults = faults.clone();
        pipeline.connect_deep_element_added(move |_pipeline, _bin, element| {
            set_up(element);
            if keep == Keep::Newest {
                be_patient(element, &counter);
            } else {
                count_entries(element, &entries);
            }
            refuse_large_pictures(element, &size_faults);
            tell_large_pictures(element, &size_faults);
        });
        let (streams, unknown_streams) = sync_channel(8);
        let has_handed_over_all = Arc::<AtomicBool>::default();
        let parts = Parts {
            pipeline: &pipeline,
            sink: &sink,
            keep,
            faults: &faults,
            unknown_streams: &streams,
            has_handed_over_all: &has_handed_over_all,
            n_damaged: &n_damaged,
        };
        let reader = make_reader(&parts)?;
        pipeline.add(&reader).map_err(|error| gstreamer_fault("build a pipeline", &error))?;
        let file = source.link(&pipeline, &reader)?;
        let bus = pipeline.bus().ok_or_else(|| Fault::Gstreamer {
            action: "build a pipeline".into(),
            detail: "the pipeline has no bus".to_owned(),
        })?;
        keep_errors_alone(&bus, &n_damaged);
        let pipeline = Pipeline {
            pipeline,
            bus,
            sink,
            link_faults,
            unknown_streams,
            n_arrived,
            n_pulled: AtomicU64::new(0),
            n_damaged,
            n_entered,
            keep,
            has_handed_over_all,
            has_secrets: hands_over,
            _file: file,
            connection: None,
        };
        Ok(Self { pipeline, faults })
    }

    /// Lets it run, fed by `client` where there is one.
    fn run(self, client: Option<Box<dyn Client>>) -> Result<Pipeline, Fault> {
        let Self { mut pipeline, faults } = self;
        if let Err(error) = pipeline.pipeline.set_state(gst::State::Playing) {
            return Err(pipeline.fault().unwrap_or_else(|| gstreamer_fault("start a pipeline", &error)));
        }
        pipeline.connection = client.map(|client| client.start(faults)).transpose()?;
        Ok(pipeline)
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        drop(self.connection.take());
        if let Err(error) = self.pipeline.set_state(gst::State::Null) {
            tracing::warn!(%error, "a pipeline did not stop");
        }
    }
}

/// Lets nothing but errors wait on the bus of a pipeline, which may run for months: what decoders complain of is counted, the
/// rest is nobody's.
fn keep_errors_alone(bus: &gst::Bus, n_damaged: &Arc<AtomicU64>) {
    let n_damaged = Arc::clone(n_damaged);
    bus.set_sync_handler(move |_bus, message| {
        match message.view() {
            gst::MessageView::Error(_) => return gst::BusSyncReply::Pass,
            gst::MessageView::Warning(_) if message.src().is_some_and(is_decoder) => {
                n_damaged.fetch_add(1, Ordering::Relaxed);
            }
            _ => {}
        }
        gst::BusSyncReply::Drop
    });
}

/// Returns the name that people have for the codec of a stream.
pub(super) fn codec_of(caps: &gst::CapsRef) -> Option<String> {
    let structure = caps.structure(0)?;
    match structure.name().as_str() {
        "image/jpeg" => Some("jpeg".to_owned()),
        "video/mpeg" => {
            let version = structure.get::<i32>("mpegversion").ok();
            Some(version.map_or("mpeg".to_owned(), |version| format!("mpeg{version}")))
        }
        "video/x-raw" => None,
        name => name.strip_prefix("video/x-").or(name.strip_prefix("image/")).map(str::to_owned),
    }
}

/// Returns whether `object` decodes by itself: decodebin, which says so too, has others do it.
pub(super) fn is_decoder(object: &gst::Object) -> bool {
    !object.is::<gst::Bin>() && is_of(object, gst::ElementFactoryType::DECODER)
}

/// Returns true where an element decodes pictures, not sound.
pub(super) fn is_picture_decoder(element: &gst::Element) -> bool {
    let object = element.upcast_ref();
    is_decoder(object) && !is_of(object, gst::ElementFactoryType::MEDIA_AUDIO)
}

fn is_of(object: &gst::Object, kind: gst::ElementFactoryType) -> bool {
    let factory = object.downcast_ref::<gst::Element>().and_then(gst::Element::factory);
    factory.is_some_and(|factory| factory.has_type(kind))
}

/// Gives a new decoder at most [`MAX_DECODER_THREADS`] threads (the property's name and type depend on the decoder). A
/// picture that libav also needs for the next ones cannot be handed on, and is copied: with "direct rendering" into memory
/// allocated for it alone, without into a pool's.
fn set_up(element: &gst::Element) {
    if !is_decoder(element.upcast_ref()) {
        return;
    }
    let available = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = available.min(MAX_DECODER_THREADS) as u32;
    for name in ["max-threads", "threads", "n-threads"] {
        match element.find_property(name).map(|property| property.value_type()) {
            Some(glib::Type::I32) => element.set_property(name, threads as i32),
            Some(glib::Type::U32) => element.set_property(name, threads),
            _ => {}
        }
    }
    if element.find_property("direct-rendering").is_some() {
        element.set_property("direct-rendering", false);
    }
}
