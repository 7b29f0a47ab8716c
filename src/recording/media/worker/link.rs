//! The way from the daemon to a worker: frames go there, and word of pictures that are not in use any more.

use super::channel::Sender;
use super::format::Format;
use super::memory::MappedBlock;
use super::message::{FrameTimes, ToWorker};
use crate::media::planes::reference_nanos;
use gstreamer as gst;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use videofields_vision::lock::lock;

/// The way to a worker that pictures and a pipeline's threads share.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) sender: Mutex<Sender>,
    /// Pictures that are not in use any more and of which the worker does not know.
    released: Mutex<Vec<u32>>,
    /// Bytes of memory in which pictures are that are in use.
    pub(super) held_bytes: AtomicU64,
    /// Reason for which frames cannot be handed over.
    pub(super) unfit: Mutex<Option<String>>,
}

impl Link {
    pub(super) fn new(sender: Sender) -> Self {
        Self {
            sender: Mutex::new(sender),
            released: Mutex::default(),
            held_bytes: AtomicU64::new(0),
            unfit: Mutex::default(),
        }
    }

    /// Sends a message with the bytes behind it.
    ///
    /// # Errors
    /// When the worker is gone or takes too long; nothing more is sent then.
    pub(super) fn send(&self, message: &ToWorker, payload: &[u8]) -> std::io::Result<()> {
        lock(&self.sender).send(message, payload, None)
    }

    /// Tells that a picture is not in use any more, now where that needs no waiting, else later.
    fn release(&self, ticket: u32, n_bytes: u64) {
        self.held_bytes.fetch_sub(n_bytes, Ordering::Relaxed);
        if let Ok(mut sender) = self.sender.try_lock()
            && sender.try_send(&ToWorker::Release(ticket))
        {
            return;
        }
        lock(&self.released).push(ticket);
    }

    /// Tells of pictures that were released when that would have had to wait.
    pub(super) fn flush(&self) {
        let released = std::mem::take(&mut *lock(&self.released));
        for ticket in released {
            if let Err(error) = self.send(&ToWorker::Release(ticket), &[]) {
                tracing::debug!(%error, "a worker does not take what is said to it");
                return;
            }
        }
    }
}

/// Hands a camera's encoded frames to its worker.
#[derive(Debug)]
pub(in crate::media) struct FrameFeed {
    link: Arc<Link>,
    format: Mutex<Option<gst::Caps>>,
}

impl FrameFeed {
    pub(super) fn new(link: &Arc<Link>) -> Self {
        Self { link: Arc::clone(link), format: Mutex::default() }
    }

    /// Hands over the frame in `sample`. One that cannot be is lost: the worker is gone then, which shows with its pictures.
    pub(in crate::media) fn push(&self, sample: &gst::SampleRef) {
        let (Some(caps), Some(buffer)) = (sample.caps(), sample.buffer()) else { return };
        let mut known = lock(&self.format);
        if known.as_deref() != Some(caps) {
            let Some(format) = Format::of(caps).filter(|format| format.caps().is_some()) else {
                let codec = caps.structure(0).map_or("frames of no format", |format| format.name().as_str());
                *lock(&self.link.unfit) = Some(format!("{codec} in this form cannot be decoded"));
                return;
            };
            *known = Some(caps.to_owned());
            if self.link.send(&ToWorker::Format(format), &[]).is_err() {
                return;
            }
        }
        let Ok(bytes) = buffer.map_readable() else { return };
        let segment = sample.segment().and_then(|segment| segment.downcast_ref::<gst::ClockTime>());
        let stream_time = |time| segment.map_or(Some(time), |segment| segment.to_stream_time(time));
        let times = FrameTimes::of(buffer, stream_time, reference_nanos(buffer));
        if let Err(error) = self.link.send(&ToWorker::Frame(times), &bytes) {
            tracing::debug!(%error, "a frame is not handed to its worker");
        }
    }
}

/// Bytes of a picture that a worker decoded; the worker may use them again once this is dropped.
pub(super) struct SharedPicture {
    block: Arc<MappedBlock>,
    slot: u32,
    ticket: u32,
    link: Arc<Link>,
}

impl SharedPicture {
    /// Takes the picture in a slot, which the worker knows by its ticket.
    pub(super) fn new(block: &Arc<MappedBlock>, slot: u32, ticket: u32, link: &Arc<Link>) -> Self {
        link.held_bytes.fetch_add(block.block.slot_bytes, Ordering::Relaxed);
        Self { block: Arc::clone(block), slot, ticket, link: Arc::clone(link) }
    }
}

impl AsRef<[u8]> for SharedPicture {
    fn as_ref(&self) -> &[u8] {
        self.block.slot(self.slot).unwrap_or_default()
    }
}

impl Drop for SharedPicture {
    fn drop(&mut self) {
        self.link.release(self.ticket, self.block.block.slot_bytes);
    }
}
