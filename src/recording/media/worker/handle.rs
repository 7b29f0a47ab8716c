//! The daemon's side of a worker.

#[cfg(any(test, feature = "fuzzing"))]
pub(super) mod fuzzing;

use super::channel::{Deadline, Files, MAX_PAYLOAD_BYTES, Received, Receiver, Sender, hang_up};
use super::launch::{Process, SEND_TIME};
use super::link::{FrameFeed, Link, SharedPicture};
use super::memory::MappedBlock;
use super::message::{EncodedTimes, FromWorker, Job, Matrix, PictureHead, ToWorker};
use super::sandbox::{Decoding, Sandbox};
use crate::media::encoded::EncodedFormat;
use crate::media::{EncodedFrame, EncodedQueue, Fault, Muxer, Picture, Times, announced};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::os::fd::{AsFd as _, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};
use videofields_vision::lock::lock;

/// Pictures of a file that are decoded before they are asked for.
const N_AHEAD: u32 = 4;

/// Messages that one look for a picture takes at most: no worker keeps a camera's thread busy for ever.
const MAX_MESSAGES: u32 = 4096;

/// Slots that a worker may have beyond those of the pictures that are in use: decoders build on up to sixteen, and some wait.
const MAX_SPARE_SLOTS: u64 = 64;

/// Bounds of the memory that makes, in bytes: decoders of the largest pictures take less than the second.
const MIN_SPARE_BYTES: u64 = 64 << 20;
const MAX_SPARE_BYTES: u64 = 3 << 29;

/// Most bytes that a picture may take: the largest that is allowed, with padding.
const MAX_PICTURE_BYTES: u64 = 80 << 20;

/// Looks for what holds a worker, and how long each lasts.
const MAX_LOOKS: u32 = 50;
const LOOK: Duration = Duration::from_millis(100);

/// Most letters of a reason.
const MAX_LETTERS: usize = 300;

/// Work for a worker.
pub(in crate::media) enum Work {
    /// Frames that a pipeline of the daemon hands over.
    Frames,
    /// A file, and the queue that its encoded frames go to.
    File(File, Option<Arc<EncodedQueue>>),
    /// A file's bytes.
    Stream(Box<dyn Read + Send>),
    /// Trials of things that a worker may not do.
    #[cfg(test)]
    Trial,
}

/// A worker at work. Its process ends when this is dropped.
pub(in crate::media) struct WorkerHandle {
    process: Process,
    receiver: Receiver,
    link: Arc<Link>,
    job: Job,
    stream: Option<Box<dyn Read + Send>>,
    encoded: Option<Arc<EncodedQueue>>,
    encoded_format: Option<Arc<EncodedFormat>>,
    blocks: HashMap<u32, Arc<MappedBlock>>,
    next_block: u32,
    /// Bytes of the picture for which there was no memory when it was wanted.
    wanted_bytes: Option<u64>,
    /// Pictures that were asked for and have not come.
    n_asked: u32,
    /// Number of the newest message that seeks, and of the one after which pictures come now: those before it are not shown.
    n_seeks: u32,
    n_sought: u32,
    reported: Reported,
}

/// Values that a worker has reported of itself and its stream.
#[derive(Debug, Default)]
struct Reported {
    sandbox: Option<Sandbox>,
    codec: Option<String>,
    duration_nanos: Option<i64>,
    n_damaged: u64,
    n_replaced: u64,
    n_encoded_dropped: u64,
    fault: Option<Fault>,
    has_ended: bool,
    /// True once nothing further is read.
    is_closed: bool,
}

impl std::fmt::Debug for WorkerHandle {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("WorkerHandle")
            .field("job", &self.job)
            .field("reported", &self.reported)
            .finish_non_exhaustive()
    }
}

impl WorkerHandle {
    /// Has a worker begin with `work`.
    ///
    /// # Errors
    /// When no worker can be started; all else shows with the first picture.
    pub(in crate::media) fn start(work: Work, times: Times) -> Result<Self, Fault> {
        Self::with_process(Process::take().map_err(|error| not_started(&error))?, work, times)
    }

    pub(super) fn with_process(process: Process, work: Work, times: Times) -> Result<Self, Fault> {
        let end = || process.socket().try_clone().map_err(|error| not_started(&error));
        let sender = Sender::new(end()?, Some(SEND_TIME));
        let link = Link::new(sender);
        let (job, file, stream, encoded) = match work {
            Work::Frames => (Job::Frames, None, None, None),
            Work::File(file, encoded) => {
                (Job::File { wants_encoded: encoded.is_some() }, Some(file), None, encoded)
            }
            Work::Stream(stream) => (Job::Stream, None, Some(stream), None),
            #[cfg(test)]
            Work::Trial => (Job::Trial, None, None, None),
        };
        // Nothing but encoded frames has bytes behind it.
        let max_payload_bytes = if encoded.is_some() { MAX_PAYLOAD_BYTES } else { 0 };
        let receiver = Receiver::new(end()?, Files::Refused, max_payload_bytes);
        let handle = Self {
            process,
            receiver,
            link: Arc::new(link),
            job,
            stream,
            encoded,
            encoded_format: None,
            blocks: HashMap::new(),
            next_block: 0,
            wanted_bytes: None,
            n_asked: 0,
            n_seeks: 0,
            n_sought: 0,
            reported: Reported::default(),
        };
        let begin = ToWorker::Begin(job, times);
        let sent = lock(&handle.link.sender).send(&begin, &[], file.as_ref().map(File::as_fd));
        sent.map_err(|error| not_started(&error))?;
        Ok(handle)
    }

    /// Returns what holds a worker of this machine, after starting one.
    ///
    /// # Errors
    /// When no worker can be started, or it says nothing for a while.
    pub(in crate::media) fn look_at_sandbox() -> Result<Sandbox, Fault> {
        let process = Process::start().map_err(|error| not_started(&error))?;
        let work = Work::Stream(Box::new(std::io::empty()));
        let mut handle = Self::with_process(process, work, Times::Played)?;
        for _ in 0..MAX_LOOKS {
            drop(handle.pull(LOOK));
            if let Some(sandbox) = handle.reported.sandbox {
                return Ok(sandbox);
            }
            if let Some(fault) = handle.take_fault() {
                return Err(fault);
            }
        }
        Err(Fault::Worker("it says nothing".to_owned()))
    }

    /// Lets what is live go before it, from now on.
    pub(in crate::media) fn lower_priority(&self) {
        self.process.lower_priority();
    }

    /// Returns what takes a camera's frames.
    pub(in crate::media) fn frame_feed(&self) -> FrameFeed {
        FrameFeed::new(&self.link)
    }

    /// Returns the next picture if one comes within `patience`.
    pub(in crate::media) fn pull(&mut self, patience: Duration) -> Option<Picture> {
        if self.reported.is_closed || self.reported.has_ended {
            return None;
        }
        self.link.flush();
        self.ask();
        if let Some(n_bytes) = self.wanted_bytes.take()
            && let Err(reason) = self.give_memory(n_bytes)
        {
            return self.close(reason.to_owned());
        }
        if let Some(reason) = lock(&self.link.unfit).take() {
            self.reported.fault.get_or_insert(Fault::Damaged(reason));
            return None;
        }
        let deadline = Deadline::after(patience);
        for _ in 0..MAX_MESSAGES {
            match self.receiver.receive(deadline) {
                Received::Message(message, payload) => match self.take(message, payload) {
                    Ok(Some(picture)) => return Some(picture),
                    Ok(None)
                        if self.reported.has_ended || self.reported.fault.is_some() || deadline.is_over() =>
                    {
                        return None;
                    }
                    Ok(None) => {}
                    Err(reason) => {
                        tracing::warn!(reason, "a decoding process is ended");
                        return self.close(reason.to_owned());
                    }
                },
                Received::Nothing => return None,
                Received::Closed => {
                    let reason = self.process.ending();
                    return self.close(reason);
                }
            }
        }
        None
    }

    fn close(&mut self, reason: String) -> Option<Picture> {
        self.reported.is_closed = true;
        self.reported.fault.get_or_insert(Fault::Worker(reason));
        None
    }

    /// Asks for as many pictures as are wanted ahead.
    fn ask(&mut self) {
        let wanted = if self.job == Job::Frames { 1 } else { N_AHEAD };
        while self.n_asked < wanted {
            if self.link.send(&ToWorker::Take, &[]).is_err() {
                return;
            }
            self.n_asked += 1;
        }
    }

    /// Does what a message says; a picture, if it is one. An error is a message that no worker sends that does its work.
    fn take(&mut self, message: FromWorker, payload: Vec<u8>) -> Result<Option<Picture>, &'static str> {
        match message {
            FromWorker::Ready(sandbox) => self.reported.sandbox = Some(sandbox),
            FromWorker::NeedMemory(n_bytes) => self.give_memory(n_bytes)?,
            FromWorker::Unmap(block) => drop(self.blocks.remove(&block)),
            FromWorker::NeedBytes(most) => self.give_bytes(most)?,
            FromWorker::Format(format) => {
                let caps = format.caps().filter(|_| Muxer::takes(format.codec()));
                let caps = caps.ok_or("it sent a format that is not recorded")?;
                self.encoded_format = Some(Arc::new(EncodedFormat::new(caps)));
            }
            FromWorker::Encoded(times) => self.record(times, payload),
            FromWorker::EncodedDropped(n_so_far) => {
                let n_so_far = clamped_count(n_so_far, self.reported.n_encoded_dropped);
                let n_more = n_so_far - self.reported.n_encoded_dropped;
                self.reported.n_encoded_dropped = n_so_far;
                if let Some(queue) = &self.encoded {
                    queue.drop_elsewhere(n_more);
                }
            }
            FromWorker::WantsPictures => {
                if let Some(queue) = &self.encoded {
                    queue.want_pictures();
                }
            }
            FromWorker::About(codec, duration_nanos) => {
                self.reported.codec = codec.map(sanitised);
                self.reported.duration_nanos = valid_time(duration_nanos).filter(|nanos| *nanos > 0);
            }
            FromWorker::Picture(head) => {
                self.n_asked =
                    self.n_asked.checked_sub(1).ok_or("it sent more pictures than were asked for")?;
                let picture = self.picture(&head)?;
                if self.n_sought == self.n_seeks {
                    return Ok(Some(picture));
                }
                self.ask();
            }
            FromWorker::Lost { n_damaged, n_replaced } => {
                self.reported.n_damaged = clamped_count(n_damaged, self.reported.n_damaged);
                self.reported.n_replaced = clamped_count(n_replaced, self.reported.n_replaced);
            }
            FromWorker::Sought(number) => self.n_sought = number,
            FromWorker::Fault(fault) => self.reported.fault = Some(sanitised_fault(fault)),
            FromWorker::Ended => self.reported.has_ended = self.n_sought == self.n_seeks,
        }
        Ok(None)
    }

    fn give_memory(&mut self, n_bytes: u64) -> Result<(), &'static str> {
        if n_bytes == 0 || n_bytes > MAX_PICTURE_BYTES {
            return Err("it asked for memory for a picture beyond the limits");
        }
        let had_bytes: u64 = self.blocks.values().map(|block| block.len_bytes()).sum();
        let spare_bytes = had_bytes.saturating_sub(self.link.held_bytes.load(Ordering::Relaxed));
        if spare_bytes >= (MAX_SPARE_SLOTS * n_bytes).clamp(MIN_SPARE_BYTES, MAX_SPARE_BYTES) {
            tracing::warn!(spare_bytes, "a decoding process wants more memory than its pictures take");
            self.answer(&ToWorker::NoMemory, None);
            return Ok(());
        }
        match MappedBlock::make(self.next_block, n_bytes) {
            Ok((pictures, file)) => {
                self.next_block = self.next_block.wrapping_add(1);
                let block = pictures.block;
                self.blocks.insert(block.id, Arc::new(pictures));
                self.answer(&ToWorker::Memory(block), Some(&file));
            }
            Err(error) if !is_shortage(&error) => {
                tracing::error!(%error, "no memory for pictures can be made");
                return Err("no memory for its pictures can be made");
            }
            Err(error) => {
                // The worker waits, and so do its pictures.
                tracing::debug!(%error, "there is no memory for more pictures of a stream now");
                self.wanted_bytes = Some(n_bytes);
            }
        }
        Ok(())
    }

    /// Answers a worker; one that is gone shows when it is read.
    fn answer(&self, message: &ToWorker, file: Option<&OwnedFd>) {
        if let Err(error) = lock(&self.link.sender).send(message, &[], file.map(OwnedFd::as_fd)) {
            tracing::debug!(%error, "a worker is not answered");
        }
    }

    fn give_bytes(&mut self, most: u32) -> Result<(), &'static str> {
        let stream = self.stream.as_mut().ok_or("it asked for bytes of a file that it does not read")?;
        let mut bytes = vec![0; (most as usize).min(MAX_CHUNK_BYTES)];
        let answer = match stream.read(&mut bytes) {
            Ok(n_bytes) => {
                bytes.truncate(n_bytes);
                ToWorker::Bytes
            }
            Err(error) => {
                tracing::debug!(%error, "a stream is read no further");
                bytes.clear();
                ToWorker::Unreadable
            }
        };
        if let Err(error) = self.link.send(&answer, &bytes) {
            tracing::debug!(%error, "a worker is not answered");
        }
        Ok(())
    }

    fn record(&self, times: EncodedTimes, bytes: Vec<u8>) {
        if let (Some(queue), Some(format)) = (&self.encoded, &self.encoded_format) {
            queue.push(EncodedFrame::from_bytes(
                bytes,
                Arc::clone(format),
                ([valid_time(times.stream_nanos), valid_time(times.interval_nanos)], times.number),
                times.build,
            ));
        }
    }

    fn picture(&self, head: &PictureHead) -> Result<Picture, &'static str> {
        if announced::is_too_large((head.width, head.height)) {
            return Err("it sent a picture beyond the limits");
        }
        let pictures =
            self.blocks.get(&head.block).ok_or("it sent a picture in memory that it does not have")?;
        let shared = SharedPicture::new(pictures, head.slot, head.ticket, &self.link);
        let layout = YuvLayout {
            width: head.width,
            height: head.height,
            offsets: head.offsets.map(|offset| offset as usize),
            strides: head.strides.map(|stride| stride as usize),
        };
        let matrix = match head.matrix {
            Matrix::Bt601 => ColorMatrix::Bt601,
            Matrix::Bt709 => ColorMatrix::Bt709,
            Matrix::Bt2020 => ColorMatrix::Bt2020,
        };
        let range = if head.is_full_range { ColorRange::Full } else { ColorRange::Limited };
        let image = YuvImage::new(layout, matrix, range, shared);
        let image = image.map_err(|_unfit| "it sent a picture that does not lie in its memory")?;
        Ok(Picture {
            image,
            stream_nanos: valid_time(head.stream_nanos),
            interval_nanos: valid_time(head.interval_nanos),
            reference_nanos: valid_time(head.reference_nanos),
            encoded_number: head.encoded_number,
        })
    }

    /// Has it go on at the key frame before a time.
    pub(in crate::media) fn seek(&mut self, stream_nanos: i64) {
        let number = self.n_seeks.wrapping_add(1);
        if self.link.send(&ToWorker::Seek(number, stream_nanos), &[]).is_ok() {
            self.n_seeks = number;
            self.reported.has_ended = false;
        }
    }

    /// Returns what went wrong since the last call, if anything did.
    pub(in crate::media) const fn take_fault(&mut self) -> Option<Fault> {
        self.reported.fault.take()
    }

    pub(in crate::media) const fn has_ended(&self) -> bool {
        self.reported.has_ended
    }

    pub(in crate::media) fn codec(&self) -> Option<String> {
        self.reported.codec.clone()
    }

    pub(in crate::media) const fn duration_nanos(&self) -> Option<i64> {
        self.reported.duration_nanos
    }

    pub(in crate::media) const fn n_damaged(&self) -> u64 {
        self.reported.n_damaged
    }

    pub(in crate::media) const fn n_replaced(&self) -> u64 {
        self.reported.n_replaced
    }

    /// Returns its process and what holds it, once it has said so.
    pub(in crate::media) fn decoding(&self) -> Option<Decoding> {
        let (process_id, has_control_group) = (self.process.id(), self.process.has_control_group());
        Some(Decoding { process_id, sandbox: self.reported.sandbox?, has_control_group })
    }
}

impl Drop for WorkerHandle {
    fn drop(&mut self) {
        // Threads that hand over frames do not wait for it any more.
        // Not by the sender, which a thread may have that waits.
        hang_up(self.process.socket());
    }
}

/// Largest count of a worker that is believed.
const MAX_COUNT: u64 = 1 << 40;

/// Longest time of a worker that is believed: some 73 years.
const MAX_NANOS: i64 = 1 << 61;

/// Most bytes of a file that are handed over at once.
const MAX_CHUNK_BYTES: usize = 1 << 20;

/// Returns true where memory or descriptors are wanting, of which others may give some back.
fn is_shortage(error: &std::io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::EMFILE | libc::ENFILE | libc::ENOMEM))
}

/// Returns a count that a worker tells, which only grows.
fn clamped_count(reported: u64, before: u64) -> u64 {
    reported.clamp(before, MAX_COUNT.max(before))
}

/// Returns a time that a worker tells, where it is one.
fn valid_time(nanos: Option<i64>) -> Option<i64> {
    nanos.filter(|nanos| (0..=MAX_NANOS).contains(nanos))
}

fn not_started(error: &std::io::Error) -> Fault {
    Fault::Gstreamer { action: "start a decoding process".into(), detail: error.to_string() }
}

/// Returns a text of a worker without what it should not hold.
fn sanitised(text: String) -> String {
    text.chars().take(MAX_LETTERS).filter(|letter| !letter.is_control()).collect()
}

fn sanitised_fault(fault: Fault) -> Fault {
    match fault {
        Fault::NotVideo(detail) => Fault::NotVideo(sanitised(detail)),
        Fault::MissingCodec { codec, package } => {
            Fault::MissingCodec { codec: sanitised(codec), package: sanitised(package.into_owned()).into() }
        }
        Fault::Refused { format, allowed } => {
            Fault::Refused { format: sanitised(format), allowed: sanitised(allowed) }
        }
        Fault::Damaged(detail) => Fault::Damaged(sanitised(detail)),
        Fault::Worker(detail) => Fault::Worker(sanitised(detail)),
        Fault::Gstreamer { action, detail } => {
            Fault::Gstreamer { action: sanitised(action.into_owned()).into(), detail: sanitised(detail) }
        }
        Fault::Connection(_) => Fault::Worker("it told of a connection that it does not have".to_owned()),
        fault @ Fault::TooLarge { .. } => fault,
    }
}
