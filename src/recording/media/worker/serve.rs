//! A worker at work, in its own process.

use super::allocator::{PictureAllocator, Rooms};
use super::channel::{Deadline, Files, MAX_PAYLOAD_BYTES, Received, Receiver, Sender};
use super::launch::leave;
use super::memory::{Freed, Place};
use super::message::{EncodedTimes, FromWorker, Job, Matrix, PictureHead, ToWorker};
use super::sandbox;
use crate::media::encoded::Build;
use crate::media::fault::gstreamer_fault;
use crate::media::input::{Keep, Memory, Source, make};
use crate::media::pipeline::Pipeline;
use crate::media::{EncodedQueue, Fault, Picture, PlaneReader, Times, descriptor_path};
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
use std::time::Duration;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

/// Bytes of encoded frames that wait to be sent back.
const ENCODED_BYTES: usize = 16 << 20;

/// Most encoded frames that wait to be decoded, and most bytes of them; then those up to the next key frame are left out.
const MAX_FRAMES: u64 = 128;
const MAX_FRAME_BYTES: u64 = 64 << 20;

/// Time that one look for a picture lasts.
const LOOK: Duration = Duration::from_millis(100);

/// Looks in a row that find nothing at work until a file counts as given up.
const MAX_IDLE_LOOKS: u32 = 10;

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
    let desk = Arc::new(Desk::new(sender, job));
    desk.send(&FromWorker::Ready(sandbox), &[]);
    #[cfg(test)]
    if job == Job::Trial {
        desk.send(&FromWorker::Fault(Fault::Damaged(super::trial::results())), &[]);
        while let Received::Message(_, _) = receiver.receive::<ToWorker>(Deadline::NEVER) {}
        return 0;
    }
    let begun = begun.map_err(|error| gstreamer_fault("start", &error));
    let work = begun.and_then(|()| Work::begin(job, times, file, &desk));
    match work {
        Ok(work) => work.listen(&mut receiver),
        Err(fault) => {
            desk.send(&FromWorker::Fault(cut(fault)), &[]);
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
struct Desk {
    sender: Arc<Mutex<Sender>>,
    rooms: Arc<Rooms>,
    wishes: Mutex<Wishes>,
    wished: Condvar,
    /// Encoded frames that were left out, since too many waited.
    n_left_out: AtomicU64,
    /// Pictures that the daemon has, by their tickets.
    held: Mutex<HashMap<u32, Held>>,
}

/// Wishes of the daemon to the thread that takes pictures.
#[derive(Debug, Default)]
struct Wishes {
    n_pictures: u32,
    /// Number of the newest message that seeks, and the time that it seeks.
    seek: Option<(u32, i64)>,
}

/// A picture that the daemon has.
#[expect(dead_code, reason = "they hold memory until they are dropped")]
enum Held {
    Decoded(YuvImage),
    Copied(Place),
}

impl Desk {
    fn new(sender: Arc<Mutex<Sender>>, job: Job) -> Self {
        let becomes = if job == Job::Stream { Freed::GivenBack } else { Freed::Kept };
        let rooms = Arc::new(Rooms::new(Arc::clone(&sender), becomes));
        Self {
            sender,
            rooms,
            wishes: Mutex::default(),
            wished: Condvar::new(),
            n_left_out: AtomicU64::new(0),
            held: Mutex::default(),
        }
    }

    fn send(&self, message: &FromWorker, payload: &[u8]) {
        if lock(&self.sender).send(message, payload, None).is_err() {
            // Without the daemon there is nothing to do.
            leave(0);
        }
    }

    fn wish(&self, change: impl FnOnce(&mut Wishes)) {
        change(&mut lock(&self.wishes));
        self.wished.notify_all();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Shortens what a fault says.
fn cut(fault: Fault) -> Fault {
    let short = |text: String| text.chars().take(MAX_LETTERS).collect();
    match fault {
        Fault::NotVideo(detail) => Fault::NotVideo(short(detail)),
        Fault::Damaged(detail) => Fault::Damaged(short(detail)),
        other => other,
    }
}

struct Work {
    desk: Arc<Desk>,
    /// Takes encoded frames, where they come as such.
    frames: Option<gst_app::AppSrc>,
    /// Takes bytes of a file that comes as such.
    bytes: Option<SyncSender<Option<Vec<u8>>>>,
    /// True where frames were left out, until the next one goes in.
    has_left_out: bool,
}

impl Work {
    fn begin(job: Job, times: Times, file: Option<File>, desk: &Arc<Desk>) -> Result<Self, Fault> {
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
                let reader =
                    AskedBytes { desk: Arc::clone(desk), answers: Mutex::new(receiver), is_over: false };
                Source::stream(reader)?
            }
        };
        let source = source.with_allocator(PictureAllocator::new(&desk.rooms).upcast());
        let wants_encoded = matches!(job, Job::File { wants_encoded: true });
        let encoded = wants_encoded.then(|| Arc::new(EncodedQueue::new(ENCODED_BYTES)));
        let pipeline = Pipeline::start(source, encoded.as_ref())?;
        let taker = Taker {
            desk: Arc::clone(desk),
            pipeline,
            encoded,
            reader: PlaneReader::new(times),
            job,
            file,
            next_ticket: 0,
            told: Told::default(),
        };
        std::thread::Builder::new()
            .name("pictures".to_owned())
            .spawn(move || taker.run())
            .map_err(|error| gstreamer_fault("start a worker's thread", &error))?;
        Ok(Self { desk: Arc::clone(desk), frames, bytes, has_left_out: false })
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
                ToWorker::Memory(room) => {
                    self.desk.rooms.answer(receiver.take_file().map(|file| (file, room)));
                }
                ToWorker::NoMemory => self.desk.rooms.answer(None),
                ToWorker::Bytes => self.answer(Some(payload)),
                ToWorker::Unreadable => self.answer(None),
                ToWorker::Take => self.desk.wish(|wishes| wishes.n_pictures += 1),
                ToWorker::Seek(number, nanos) => self.desk.wish(|wishes| wishes.seek = Some((number, nanos))),
                ToWorker::Release(ticket) => drop(lock(&self.desk.held).remove(&ticket)),
            }
        }
    }

    /// Has a frame decoded, unless too many wait already.
    fn push(&mut self, mut buffer: gst::Buffer) {
        let Some(source) = &self.frames else { return };
        let is_full =
            source.current_level_buffers() >= MAX_FRAMES || source.current_level_bytes() >= MAX_FRAME_BYTES;
        if is_full {
            self.desk.n_left_out.fetch_add(1, Ordering::Relaxed);
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
        if let Some(taker) = &self.bytes {
            // Who asked for them may be gone.
            drop(taker.try_send(bytes));
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
struct AskedBytes {
    desk: Arc<Desk>,
    answers: Mutex<Bytes<Option<Vec<u8>>>>,
    is_over: bool,
}

impl Read for AskedBytes {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.is_over {
            return Ok(0);
        }
        let most = u32::try_from(into.len()).unwrap_or(u32::MAX);
        self.desk.send(&FromWorker::NeedBytes(most), &[]);
        let answer = lock(&self.answers).recv().map_err(io::Error::other)?;
        let bytes = answer.ok_or_else(|| io::Error::other("the file cannot be read"))?;
        self.is_over = bytes.is_empty();
        let n_bytes = bytes.len().min(into.len());
        into[..n_bytes].copy_from_slice(&bytes[..n_bytes]);
        Ok(n_bytes)
    }
}

/// Things that the daemon was told.
#[derive(Debug, Default)]
struct Told {
    format: Option<gst::Caps>,
    has_about: bool,
    wants_pictures: bool,
    lost: (u64, u64),
    n_encoded_dropped: u64,
}

/// Takes pictures as they are decoded and sends them.
struct Taker {
    desk: Arc<Desk>,
    pipeline: Pipeline,
    encoded: Option<Arc<EncodedQueue>>,
    reader: PlaneReader,
    job: Job,
    /// Kept open, since the pipeline opens it by its descriptor.
    #[expect(dead_code, reason = "it is held open")]
    file: Option<File>,
    next_ticket: u32,
    told: Told,
}

impl Taker {
    fn run(mut self) {
        let mut n_idle_looks = 0;
        loop {
            if let Some((number, nanos)) = self.wait() {
                let is_sought = self.pipeline.seek(nanos);
                tracing::debug!(is_sought, "a file is sought in");
                self.desk.send(&FromWorker::Sought(number), &[]);
                // It may be that no picture is wanted yet.
                continue;
            }
            if let Some(sample) = self.pipeline.pull(LOOK) {
                n_idle_looks = 0;
                self.tell_beside();
                match self.reader.picture(&sample) {
                    Ok(picture) => self.send(picture),
                    Err(error) => return self.fail(Fault::Damaged(error.to_string())),
                }
                continue;
            }
            self.tell_beside();
            if let Some(fault) = self.pipeline.fault() {
                return self.fail(fault);
            }
            if self.pipeline.has_ended() {
                self.tell_beside();
                self.desk.send(&FromWorker::Ended, &[]);
                self.wait_for_seek();
                continue;
            }
            let may_rest = self.job == Job::Frames || !self.pipeline.is_idle();
            n_idle_looks = if may_rest { 0 } else { n_idle_looks + 1 };
            if n_idle_looks == MAX_IDLE_LOOKS {
                let unread = self.pipeline.unread_video();
                let silent = || Fault::Damaged("its reader gave up without a word".to_owned());
                return self.fail(unread.unwrap_or_else(silent));
            }
        }
    }

    fn fail(&mut self, fault: Fault) {
        self.tell_beside();
        self.desk.send(&FromWorker::Fault(cut(fault)), &[]);
    }

    /// Waits until a picture is wanted; where to go on, if the daemon said so.
    fn wait(&self) -> Option<(u32, i64)> {
        let mut wishes = lock(&self.desk.wishes);
        while wishes.n_pictures == 0 && wishes.seek.is_none() {
            wishes = self.desk.wished.wait(wishes).unwrap_or_else(PoisonError::into_inner);
        }
        wishes.seek.take()
    }

    fn wait_for_seek(&self) {
        let mut wishes = lock(&self.desk.wishes);
        while wishes.seek.is_none() {
            wishes = self.desk.wished.wait(wishes).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Tells what comes beside pictures: encoded frames, numbers.
    fn tell_beside(&mut self) {
        if let Some(queue) = self.encoded.clone() {
            if queue.wants_pictures() && !std::mem::replace(&mut self.told.wants_pictures, true) {
                self.desk.send(&FromWorker::WantsPictures, &[]);
            }
            while let Some(frame) = queue.take() {
                self.send_encoded(&frame);
            }
            let n_dropped = queue.n_dropped();
            if std::mem::replace(&mut self.told.n_encoded_dropped, n_dropped) != n_dropped {
                self.desk.send(&FromWorker::EncodedDropped(n_dropped), &[]);
            }
        }
        let n_left_out = self.desk.n_left_out.load(Ordering::Relaxed);
        let lost = (self.pipeline.n_damaged() + n_left_out, self.pipeline.n_replaced());
        if std::mem::replace(&mut self.told.lost, lost) != lost {
            self.desk.send(&FromWorker::Lost { n_damaged: lost.0, n_replaced: lost.1 }, &[]);
        }
    }

    fn send_encoded(&mut self, frame: &crate::media::EncodedFrame) {
        let caps = frame.format.caps();
        if self.told.format.as_ref() != Some(caps) {
            let Some(format) = super::format::Format::of(caps) else {
                // It cannot be told, so its pictures are recorded.
                self.desk.send(&FromWorker::WantsPictures, &[]);
                return;
            };
            self.told.format = Some(caps.clone());
            self.desk.send(&FromWorker::Format(format), &[]);
        }
        let Ok(bytes) = frame.buffer().map_readable() else { return };
        let times = EncodedTimes {
            stream_nanos: frame.stream_nanos,
            interval_nanos: frame.interval_nanos,
            build: if frame.is_key { Build::Key } else { Build::Delta },
        };
        self.desk.send(&FromWorker::Encoded(times), &bytes);
    }

    fn send(&mut self, picture: Picture) {
        if !std::mem::replace(&mut self.told.has_about, true) {
            let about = FromWorker::About(self.pipeline.codec(), self.pipeline.duration_nanos());
            self.desk.send(&about, &[]);
        }
        let Picture { image, stream_nanos, interval_nanos, reference_nanos } = picture;
        let (matrix, is_full_range) = (matrix(image.matrix()), image.range() == ColorRange::Full);
        let (width, height) = (image.width(), image.height());
        let (laid, held) = if let Some(laid) = self.find(&image) {
            (laid, Held::Decoded(image))
        } else if let Some((laid, place)) = self.copy(&image) {
            (laid, Held::Copied(place))
        } else {
            return self.fail(Fault::Damaged("there is no memory for its pictures".to_owned()));
        };
        let ticket = self.next_ticket;
        self.next_ticket = self.next_ticket.wrapping_add(1);
        lock(&self.desk.held).insert(ticket, held);
        let head = PictureHead {
            ticket,
            room: laid.room,
            place: laid.place,
            width,
            height,
            offsets: laid.offsets,
            strides: laid.strides,
            matrix,
            is_full_range,
            stream_nanos,
            interval_nanos,
            reference_nanos,
        };
        lock(&self.desk.wishes).n_pictures -= 1;
        self.desk.send(&FromWorker::Picture(head), &[]);
    }

    /// Returns where a picture lies in the daemon's memory; none where its decoder wrote it elsewhere.
    fn find(&self, image: &YuvImage) -> Option<Laid> {
        let found = [0, 1, 2].map(|plane| self.desk.rooms.find(image.plane(plane).data.as_ptr() as usize));
        let [Some(luma), Some(u), Some(v)] = found else { return None };
        let is_one = [u, v].iter().all(|other| (other.room, other.place) == (luma.room, luma.place));
        let strides = [0, 1, 2].map(|plane| image.plane(plane).stride as u32);
        let offsets = [luma.offset, u.offset, v.offset];
        is_one.then_some(Laid { room: luma.room, place: luma.place, offsets, strides })
    }

    /// Copies a picture into the daemon's memory: one that came unencoded, or of a decoder with memory of its own.
    fn copy(&self, image: &YuvImage) -> Option<(Laid, Place)> {
        let (width, height) = (image.width(), image.height());
        let layout = YuvLayout::packed(width, height);
        let mut place = self.desk.rooms.place(YuvLayout::packed_len(width, height))?;
        let (room, number) = (place.room(), place.number());
        for (plane, into) in layout.split_mut(place.as_mut()).into_iter().enumerate() {
            let from = image.plane(plane);
            for (y, row) in
                into.chunks_exact_mut(layout.strides[plane]).take(from.height as usize).enumerate()
            {
                row.copy_from_slice(from.row(y as u32));
            }
        }
        let laid = Laid {
            room,
            place: number,
            offsets: layout.offsets.map(|offset| offset as u32),
            strides: layout.strides.map(|stride| stride as u32),
        };
        Some((laid, place))
    }
}

/// A picture's place in the daemon's memory.
#[derive(Clone, Copy, Debug)]
struct Laid {
    room: u32,
    place: u32,
    offsets: [u32; 3],
    strides: [u32; 3],
}

const fn matrix(matrix: ColorMatrix) -> Matrix {
    match matrix {
        ColorMatrix::Bt601 => Matrix::Bt601,
        ColorMatrix::Bt709 => Matrix::Bt709,
        ColorMatrix::Bt2020 => Matrix::Bt2020,
    }
}
