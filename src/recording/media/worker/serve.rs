//! A worker at work, in its own process.

use super::allocator::{PictureAllocator, SlotPool};
use super::channel::{Deadline, Files, MAX_PAYLOAD_BYTES, Received, Receiver, Sender};
use super::launch::leave;
use super::memory::{OnFree, Slot};
use super::message::{FromWorker, Job, ToWorker};
use super::pictures::PictureSender;
use super::sandbox;
use crate::media::fault::gstreamer_fault;
use crate::media::input::{Keep, Memory, Source, make};
use crate::media::pipeline::Pipeline;
use crate::media::{EncodedQueue, Fault, PlaneReader, Times, descriptor_path};
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::os::fd::{AsFd as _, OwnedFd};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver as Bytes, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use videofields_vision::frame::YuvImage;
use videofields_vision::lock::lock;

/// Bytes of encoded frames that wait to be sent back.
const ENCODED_BYTES: usize = 16 << 20;

/// Most encoded frames that wait to be decoded, and most bytes of them; then those up to the next key frame are left out.
const MAX_FRAMES: u64 = 128;
const MAX_FRAME_BYTES: u64 = 64 << 20;

/// Most letters of what a fault says.
const MAX_LETTERS: usize = 300;

/// Does the work that comes over `socket` until the daemon hangs up; the status with which the process ends.
pub(super) fn serve(socket: &OwnedFd) -> i32 {
    crate::memory::settle();
    let (Ok(from), Ok(to)) = (socket.try_clone(), socket.try_clone()) else { return 1 };
    // Whatever fails here fails once more below, and is told then.
    let begun = gst::init();
    if begun.is_ok() {
        load_usual_plugins();
    }
    let mut receiver = Receiver::new(from, Files::Kept(Vec::new()), MAX_PAYLOAD_BYTES);
    let Received::Message(ToWorker::Begin(job, times), _) = receiver.receive(Deadline::NEVER) else {
        return 0;
    };
    let file = receiver.take_file().map(File::from);
    let sandbox = sandbox::confine(file.as_ref().map(File::as_fd));
    let sender = Arc::new(Mutex::new(Sender::new(to, None)));
    let shared = Arc::new(Shared::new(sender, job));
    shared.send(&FromWorker::Ready(sandbox), &[]);
    #[cfg(test)]
    if job == Job::Trial {
        shared.send(&FromWorker::Fault(Fault::Damaged(super::trial::results())), &[]);
        while let Received::Message(_, _) = receiver.receive::<ToWorker>(Deadline::NEVER) {}
        return 0;
    }
    let begun = begun.map_err(|error| gstreamer_fault("start", &error));
    let work = begun.and_then(|()| Runner::begin(job, times, file, &shared));
    match work {
        Ok(work) => work.listen(&mut receiver),
        Err(fault) => {
            shared.send(&FromWorker::Fault(shortened(fault)), &[]);
            // The daemon hangs up once it has read that.
            while let Received::Message(_, _) = receiver.receive::<ToWorker>(Deadline::NEVER) {}
        }
    }
    0
}

/// Elements that most workers need. A worker that waits has their libraries at hand, so that the first picture comes sooner.
const USUAL: [&str; 7] =
    ["appsrc", "avdec_h264", "capsfilter", "decodebin", "h264parse", "matroskademux", "videoconvert"];

fn load_usual_plugins() {
    for name in USUAL {
        let loaded = gst::ElementFactory::find(name).map(|factory| factory.load());
        if !matches!(loaded, Some(Ok(_))) {
            // Whoever needs it is told then.
            tracing::debug!(name, "an element is not there");
        }
    }
}

/// State that all threads of a worker share.
pub(super) struct Shared {
    sender: Arc<Mutex<Sender>>,
    pub(super) slots: Arc<SlotPool>,
    pub(super) requests: Mutex<Requests>,
    changed: Condvar,
    /// Encoded frames that were left out, since too many waited.
    pub(super) n_left_out: AtomicU64,
    /// Pictures that the daemon has, by their tickets.
    pub(super) held: Mutex<HashMap<u32, Held>>,
}

/// Requests of the daemon to the thread that takes pictures.
#[derive(Debug, Default)]
pub(super) struct Requests {
    pub(super) n_pictures: u32,
    /// Number of the newest message that seeks, and the time that it seeks.
    pub(super) seek: Option<(u32, i64)>,
}

/// A picture that the daemon has.
#[expect(dead_code, reason = "they hold memory until they are dropped")]
pub(super) enum Held {
    Decoded(YuvImage),
    Copied(Slot),
}

impl Shared {
    fn new(sender: Arc<Mutex<Sender>>, job: Job) -> Self {
        let on_free = if job == Job::Stream { OnFree::GiveBack } else { OnFree::Keep };
        let slots = Arc::new(SlotPool::new(Arc::clone(&sender), on_free));
        Self {
            sender,
            slots,
            requests: Mutex::default(),
            changed: Condvar::new(),
            n_left_out: AtomicU64::new(0),
            held: Mutex::default(),
        }
    }

    /// Sends a message with the bytes behind it; without the daemon the worker ends.
    pub(super) fn send(&self, message: &FromWorker, payload: &[u8]) {
        if lock(&self.sender).send(message, payload, None).is_err() {
            // Without the daemon there is nothing to do.
            leave(0);
        }
    }

    /// Waits until the requests are as `is_reached` has it.
    pub(super) fn wait_for(&self, is_reached: impl Fn(&Requests) -> bool) -> MutexGuard<'_, Requests> {
        let mut requests = lock(&self.requests);
        while !is_reached(&requests) {
            requests = self.changed.wait(requests).unwrap_or_else(PoisonError::into_inner);
        }
        requests
    }

    fn change_requests(&self, change: impl FnOnce(&mut Requests)) {
        change(&mut lock(&self.requests));
        self.changed.notify_all();
    }
}

/// Shortens what a fault says.
pub(super) fn shortened(fault: Fault) -> Fault {
    let short = |text: String| text.chars().take(MAX_LETTERS).collect();
    match fault {
        Fault::NotVideo(detail) => Fault::NotVideo(short(detail)),
        Fault::Damaged(detail) => Fault::Damaged(short(detail)),
        other => other,
    }
}

struct Runner {
    shared: Arc<Shared>,
    /// Takes encoded frames, where they come as such.
    frames: Option<gst_app::AppSrc>,
    /// Takes bytes of a file that comes as such.
    bytes: Option<SyncSender<Option<Vec<u8>>>>,
    /// True where frames were left out, until the next one goes in.
    has_left_out: bool,
}

impl Runner {
    fn begin(job: Job, times: Times, file: Option<File>, shared: &Arc<Shared>) -> Result<Self, Fault> {
        let (mut frames, mut bytes) = (None, None);
        let source = match (job, &file) {
            (Job::Frames, _) => {
                let source = make_frame_source()?;
                frames = Some(source.clone());
                Source::new(vec![source.upcast()], Keep::Newest, Memory::Pooled)
            }
            (Job::File { .. }, Some(file)) => Source::file(&descriptor_path(file))?,
            (Job::File { .. }, None) => return Err(Fault::Damaged("no file came".to_owned())),
            #[cfg(test)]
            (Job::Trial, _) => unreachable!("it is done already"),
            (Job::Stream, _) => {
                let (sender, receiver) = sync_channel(1);
                bytes = Some(sender);
                let reader = RequestedBytes {
                    shared: Arc::clone(shared),
                    answers: Mutex::new(receiver),
                    is_over: false,
                };
                Source::stream(reader)?
            }
        };
        let source = source.with_allocator(PictureAllocator::new(&shared.slots).upcast());
        let wants_encoded = matches!(job, Job::File { wants_encoded: true });
        let encoded = wants_encoded.then(|| Arc::new(EncodedQueue::new(ENCODED_BYTES)));
        let pipeline = Pipeline::start(source, encoded.as_ref())?;
        let pictures = PictureSender::new(shared, (pipeline, encoded), (PlaneReader::new(times), job), file);
        std::thread::Builder::new()
            .name("pictures".to_owned())
            .spawn(move || pictures.run())
            .map_err(|error| gstreamer_fault("start a worker's thread", &error))?;
        Ok(Self { shared: Arc::clone(shared), frames, bytes, has_left_out: false })
    }

    /// Does what the daemon says until it hangs up.
    fn listen(mut self, receiver: &mut Receiver) {
        while let Received::Message(message, payload) = receiver.receive(Deadline::NEVER) {
            match message {
                ToWorker::Begin(..) => return,
                ToWorker::Format(format) => {
                    if let (Some(source), Some(caps)) = (&self.frames, format.caps()) {
                        source.set_caps(Some(&caps));
                    }
                }
                ToWorker::Frame(times) => self.push(times.buffer(payload)),
                ToWorker::Memory(block) => {
                    self.shared.slots.answer(receiver.take_file().map(|file| (file, block)));
                }
                ToWorker::NoMemory => self.shared.slots.answer(None),
                ToWorker::Bytes => self.answer(Some(payload)),
                ToWorker::Unreadable => self.answer(None),
                ToWorker::Take => self.shared.change_requests(|requests| requests.n_pictures += 1),
                ToWorker::Seek(number, nanos) => {
                    self.shared.change_requests(|requests| requests.seek = Some((number, nanos)));
                }
                ToWorker::Release(ticket) => drop(lock(&self.shared.held).remove(&ticket)),
            }
        }
    }

    /// Has a frame decoded, unless too many wait already.
    fn push(&mut self, mut buffer: gst::Buffer) {
        let Some(source) = &self.frames else { return };
        let is_full =
            source.current_level_buffers() >= MAX_FRAMES || source.current_level_bytes() >= MAX_FRAME_BYTES;
        if is_full {
            self.shared.n_left_out.fetch_add(1, Ordering::Relaxed);
            self.has_left_out = true;
            return;
        }
        if std::mem::take(&mut self.has_left_out)
            && let Some(buffer) = buffer.get_mut()
        {
            buffer.set_flags(gst::BufferFlags::DISCONT);
        }
        if let Err(error) = source.push_buffer(buffer) {
            // A pipeline that has failed tells that itself.
            tracing::trace!(%error, "a frame comes too late");
        }
    }

    fn answer(&self, bytes: Option<Vec<u8>>) {
        if let Some(bytes_sender) = &self.bytes
            && bytes_sender.try_send(bytes).is_err()
        {
            tracing::trace!("nobody waits for these bytes any more");
        }
    }
}

fn make_frame_source() -> Result<gst_app::AppSrc, Fault> {
    let element = make("appsrc")?;
    element.set_property("is-live", true);
    element.set_property("format", gst::Format::Time);
    element.set_property("max-bytes", 0_u64);
    element.downcast().map_err(|other| Fault::Gstreamer {
        action: "make an element".into(),
        detail: format!("appsrc is a {}", other.type_()),
    })
}

/// Asks the daemon for a file's bytes.
struct RequestedBytes {
    shared: Arc<Shared>,
    answers: Mutex<Bytes<Option<Vec<u8>>>>,
    is_over: bool,
}

impl Read for RequestedBytes {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.is_over {
            return Ok(0);
        }
        let most = u32::try_from(into.len()).unwrap_or(u32::MAX);
        self.shared.send(&FromWorker::NeedBytes(most), &[]);
        let answer = lock(&self.answers).recv().map_err(io::Error::other)?;
        let bytes = answer.ok_or_else(|| io::Error::other("the file cannot be read"))?;
        self.is_over = bytes.is_empty();
        let n_bytes = bytes.len().min(into.len());
        into[..n_bytes].copy_from_slice(&bytes[..n_bytes]);
        Ok(n_bytes)
    }
}
