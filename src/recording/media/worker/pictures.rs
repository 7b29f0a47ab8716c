//! Sends pictures to the daemon as they are decoded, and what comes beside them.

use super::format::Format;
use super::memory::Slot;
use super::message::{EncodedTimes, FromWorker, Job, Matrix, PictureHead};
use super::serve::{Held, Requests, Shared, shortened};
use crate::media::encoded::FrameKind;
use crate::media::pipeline::Pipeline;
use crate::media::{EncodedFrame, EncodedQueue, Fault, Picture, PlaneReader};
use gstreamer as gst;
use std::fs::File;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};
use videofields_vision::lock::lock;

/// Time that one look for a picture lasts.
const LOOK: Duration = Duration::from_millis(100);

/// Looks in a row that find nothing at work until a file counts as given up.
const MAX_IDLE_LOOKS: u32 = 10;

/// Values that the daemon has been told.
#[derive(Debug, Default)]
struct Reported {
    format: Option<gst::Caps>,
    has_about: bool,
    wants_pictures: bool,
    lost: (u64, u64),
    n_encoded_dropped: u64,
}

/// Takes pictures as they are decoded and sends them.
pub(super) struct PictureSender {
    shared: Arc<Shared>,
    pipeline: Pipeline,
    encoded: Option<Arc<EncodedQueue>>,
    reader: PlaneReader,
    job: Job,
    /// Kept open, since the pipeline opens it by its descriptor.
    #[expect(dead_code, reason = "it is held open")]
    file: Option<File>,
    next_ticket: u32,
    reported: Reported,
}

impl PictureSender {
    /// Makes one for what `pipeline` decodes, whose encoded frames wait in `encoded`.
    pub(super) fn new(
        shared: &Arc<Shared>,
        (pipeline, encoded): (Pipeline, Option<Arc<EncodedQueue>>),
        (reader, job): (PlaneReader, Job),
        file: Option<File>,
    ) -> Self {
        let (shared, reported) = (Arc::clone(shared), Reported::default());
        Self { shared, pipeline, encoded, reader, job, file, next_ticket: 0, reported }
    }

    /// Sends pictures until the stream fails.
    pub(super) fn run(mut self) {
        let mut n_idle_looks = 0;
        loop {
            if let Some((number, nanos)) = self.wait() {
                let is_sought = self.pipeline.seek(nanos);
                tracing::debug!(is_sought, "a file is sought in");
                self.shared.send(&FromWorker::Sought(number), &[]);
                // It may be that no picture is wanted yet.
                continue;
            }
            if let Some(sample) = self.pipeline.pull(LOOK) {
                n_idle_looks = 0;
                self.report_beside();
                match self.reader.picture(&sample) {
                    Ok(picture) => self.send(picture),
                    Err(error) => return self.fail(Fault::Damaged(error.to_string())),
                }
                continue;
            }
            self.report_beside();
            if let Some(fault) = self.pipeline.fault() {
                return self.fail(fault);
            }
            if self.pipeline.has_ended() {
                self.report_beside();
                self.shared.send(&FromWorker::Ended, &[]);
                drop(self.shared.wait_for(|requests| requests.seek.is_some()));
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
        self.report_beside();
        self.shared.send(&FromWorker::Fault(shortened(fault)), &[]);
    }

    /// Waits until a picture is wanted; the number and the time of a seek, if one is.
    fn wait(&self) -> Option<(u32, i64)> {
        let is_reached = |requests: &Requests| requests.n_pictures > 0 || requests.seek.is_some();
        self.shared.wait_for(is_reached).seek.take()
    }

    /// Reports what comes beside pictures: encoded frames, numbers.
    fn report_beside(&mut self) {
        if let Some(queue) = self.encoded.clone() {
            if queue.wants_pictures() && !std::mem::replace(&mut self.reported.wants_pictures, true) {
                self.shared.send(&FromWorker::WantsPictures, &[]);
            }
            while let Some(frame) = queue.take() {
                self.send_encoded(&frame);
            }
            let n_dropped = queue.n_dropped();
            if std::mem::replace(&mut self.reported.n_encoded_dropped, n_dropped) != n_dropped {
                self.shared.send(&FromWorker::EncodedDropped(n_dropped), &[]);
            }
        }
        let n_left_out = self.shared.n_left_out.load(Ordering::Relaxed);
        let lost = (self.pipeline.n_damaged() + n_left_out, self.pipeline.n_replaced());
        if std::mem::replace(&mut self.reported.lost, lost) != lost {
            self.shared.send(&FromWorker::Lost { n_damaged: lost.0, n_replaced: lost.1 }, &[]);
        }
    }

    fn send_encoded(&mut self, frame: &EncodedFrame) {
        let caps = frame.format.caps();
        if self.reported.format.as_ref() != Some(caps) {
            let Some(format) = Format::of(caps) else {
                // It cannot be described, so its pictures are recorded.
                self.shared.send(&FromWorker::WantsPictures, &[]);
                return;
            };
            self.reported.format = Some(caps.clone());
            self.shared.send(&FromWorker::Format(format), &[]);
        }
        let Ok(bytes) = frame.buffer().map_readable() else { return };
        let times = EncodedTimes {
            stream_nanos: frame.stream_nanos,
            interval_nanos: frame.interval_nanos,
            number: frame.number,
            build: if frame.is_key { FrameKind::Key } else { FrameKind::Delta },
        };
        self.shared.send(&FromWorker::Encoded(times), &bytes);
    }

    fn send(&mut self, picture: Picture) {
        if !std::mem::replace(&mut self.reported.has_about, true) {
            let about = FromWorker::About(self.pipeline.codec(), self.pipeline.duration_nanos());
            self.shared.send(&about, &[]);
        }
        let Picture { image, stream_nanos, interval_nanos, reference_nanos, encoded_number } = picture;
        let (matrix, is_full_range) = (matrix(image.matrix()), image.range() == ColorRange::Full);
        let (width, height) = (image.width(), image.height());
        let (placed, held) = if let Some(placed) = self.find(&image) {
            (placed, Held::Decoded(image))
        } else if let Some((placed, slot)) = self.copy(&image) {
            (placed, Held::Copied(slot))
        } else {
            return self.fail(Fault::Damaged("there is no memory for its pictures".to_owned()));
        };
        let ticket = self.next_ticket;
        self.next_ticket = self.next_ticket.wrapping_add(1);
        lock(&self.shared.held).insert(ticket, held);
        let head = PictureHead {
            ticket,
            block: placed.block,
            slot: placed.slot,
            width,
            height,
            offsets: placed.offsets,
            strides: placed.strides,
            matrix,
            is_full_range,
            stream_nanos,
            interval_nanos,
            reference_nanos,
            encoded_number,
        };
        lock(&self.shared.requests).n_pictures -= 1;
        self.shared.send(&FromWorker::Picture(head), &[]);
    }

    /// Returns where a picture lies in the daemon's memory; none where its decoder wrote it elsewhere.
    fn find(&self, image: &YuvImage) -> Option<SlotLayout> {
        let found = [0, 1, 2].map(|plane| self.shared.slots.find(image.plane(plane).data.as_ptr() as usize));
        let [Some(luma), Some(u), Some(v)] = found else { return None };
        let is_one = [u, v].iter().all(|other| (other.block, other.slot) == (luma.block, luma.slot));
        let strides = [0, 1, 2].map(|plane| image.plane(plane).stride as u32);
        let offsets = [luma.offset, u.offset, v.offset];
        is_one.then_some(SlotLayout { block: luma.block, slot: luma.slot, offsets, strides })
    }

    /// Copies a picture into the daemon's memory: one that came unencoded, or of a decoder with memory of its own.
    fn copy(&self, image: &YuvImage) -> Option<(SlotLayout, Slot)> {
        let (width, height) = (image.width(), image.height());
        let layout = YuvLayout::packed(width, height);
        let mut slot = self.shared.slots.take(YuvLayout::packed_len(width, height))?;
        let (block, number) = (slot.block(), slot.number());
        for (plane, into) in layout.split_mut(slot.as_mut()).into_iter().enumerate() {
            let from = image.plane(plane);
            for (y, row) in
                into.chunks_exact_mut(layout.strides[plane]).take(from.height as usize).enumerate()
            {
                row.copy_from_slice(from.row(y as u32));
            }
        }
        let placed = SlotLayout {
            block,
            slot: number,
            offsets: layout.offsets.map(|offset| offset as u32),
            strides: layout.strides.map(|stride| stride as u32),
        };
        Some((placed, slot))
    }
}

/// A picture's place in the daemon's memory.
#[derive(Clone, Copy, Debug)]
struct SlotLayout {
    block: u32,
    slot: u32,
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
