//! Recorded segments: their files, their rows, how long they are kept, and what is read of an instant.
//!
//! In: encoded frames of cameras with their scene times, by one [`Recorder`] a camera. Out: segments of a span, and a
//! [`Reading`] of an instant, whose bytes `media::Decoder` decodes; clips for people to keep (`export`). One thread writes
//! for all cameras, so that no camera waits for the disk. Knows no sources and no pixels.

mod boundaries;
mod check;
mod error;
mod export;
mod folder;
mod keys;
mod lane;
mod matroska;
mod name;
mod open_segment;
mod queue;
mod reading;
mod reconcile;
mod recorder;
mod retention;
mod scan;
mod shared;
mod survey;
mod writer;

#[cfg(test)]
mod tests;

pub use check::{Checked, check, repair};
pub use error::ArchiveError;
pub use export::{
    Clip, ExportCamera, ExportFile, ExportRequest, ExportState, ExportStatus, ExportedCamera, Exports,
    Manifest, Redraw, Redrawing, Unreadable, VerifiedExport, verify_export,
};
pub use lane::{CameraRecording, RecordingState};
pub use reading::Reading;
pub use reconcile::Reconciled;
pub use recorder::Recorder;

use crate::signing::SigningKey;
use crate::store::{SegmentRecord, Store};
use crate::telemetry::Metrics;
use shared::Shared;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::ArchiveSettings;
use videofields_vision::frame::CameraId;
use writer::Writer;

/// Time that the writer and the survey are given to end; a disk that hangs keeps no daemon from stopping.
const STOP_TIME: Duration = Duration::from_millis(900);

/// The recorded segments of all cameras, and the thread that writes them.
#[derive(Debug)]
pub struct Archive {
    shared: Arc<Shared>,
    /// Breaks off when all threads have ended.
    have_ended: Mutex<Receiver<()>>,
}

/// How recording goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArchiveStatus {
    /// Every camera that was recorded since the start, by id.
    pub cameras: Vec<CameraRecording>,
    /// Bytes of all segments.
    pub kept_bytes: u64,
    /// What was done about rows and files that did not fit together, so far.
    pub reconciled: Reconciled,
    /// Whether the database took the row that was written last; what it does not take is written later.
    pub takes_rows: bool,
}

impl Archive {
    /// Opens the archive at `settings.folder`: finishes what was left unfinished, then starts to write. A folder that
    /// cannot be used pauses all recording and is tried again every few seconds; nothing else depends on it.
    ///
    /// Must be called on the runtime that `store` was opened on, which must live until [`Self::stop`].
    ///
    /// # Errors
    /// When a thread cannot be started.
    pub async fn start(
        settings: ArchiveSettings,
        store: Store,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let (shared, have_ended) = Shared::new(settings, store, metrics, clock);
        let shared = Arc::new(shared);
        let entering = Arc::clone(&shared);
        // Reads files, and waits for the database as the writer does.
        let entered = tokio::task::spawn_blocking(move || reconcile::enter(&entering).map(|_folder| ()));
        match entered.await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::error!(%error, "nothing is recorded for now"),
            Err(error) => tracing::error!(%error, "nothing is recorded for now"),
        }
        let writer = Writer::new(Arc::clone(&shared));
        shared.start_thread("archive", move || writer.run())?;
        let exporting = Arc::clone(&shared);
        shared.start_thread("archive-export", move || export::run(&exporting))?;
        Ok(Self { shared, have_ended: Mutex::new(have_ended) })
    }

    /// The end at which a camera's frames are handed over. One at a time for a camera; dropping it ends the segment.
    #[must_use]
    pub fn recorder(&self, camera: &CameraId) -> Recorder {
        Recorder::new(Arc::clone(&self.shared), self.shared.lane(camera))
    }

    /// From now on these settings hold, in the folder of before: files that are being written end after the new time, and
    /// what may be kept and must be left free counts from the next look on.
    pub fn reconfigure(&self, settings: ArchiveSettings) {
        self.shared.set_settings(settings);
    }

    /// How recording goes.
    #[must_use]
    pub fn status(&self) -> ArchiveStatus {
        ArchiveStatus {
            cameras: self.shared.recordings(),
            kept_bytes: self.shared.kept_bytes(),
            reconciled: self.shared.reconciled(),
            takes_rows: self.shared.takes_rows(),
        }
    }

    /// A camera's segments that hold anything of a span, both ends included, in order of time, the one that is being
    /// written as far as it is safe. What lies between two is a gap. Their keys are left out.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segments(
        &self,
        camera: &CameraId,
        from: Timestamp,
        to: Timestamp,
    ) -> Result<Vec<SegmentRecord>, ArchiveError> {
        Ok(self.shared.store.segments(camera, from, to).await?)
    }

    /// Whether frames of a camera were handed over and are not in its file yet.
    #[must_use]
    pub fn is_behind(&self, camera: &CameraId) -> bool {
        self.shared.known_lane(camera).is_some_and(|lane| lane.is_behind())
    }

    /// A camera's segment that begins first after an instant, without looking into it.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn next_segment(
        &self,
        camera: &CameraId,
        after: Timestamp,
    ) -> Result<Option<SegmentRecord>, ArchiveError> {
        Ok(self.shared.store.segment_after(camera, after).await?)
    }

    /// The bytes from which a camera's frame of an instant is decoded: those of the segment that begins last at or
    /// before it, from the last key frame at or before it. An instant behind the segment's end is no failure: what is
    /// newest in it is decoded last. None where nothing is recorded before the instant.
    ///
    /// # Errors
    /// When the file cannot be read, or the database fails.
    pub async fn open_at(&self, camera: &CameraId, at: Timestamp) -> Result<Option<Reading>, ArchiveError> {
        let segment = self.shared.store.segment_before(camera, at).await?;
        segment.map(|segment| self.shared.open(segment, at)).transpose()
    }

    /// What was exported or is to be.
    #[must_use]
    pub fn exports(&self) -> &Exports {
        &self.shared.exports
    }

    /// Asks for clips of what was recorded. Answers none where as many wait as may, or the folder cannot be used yet.
    ///
    /// # Errors
    /// When the export's folder cannot be made.
    pub fn export(&self, request: ExportRequest) -> Result<Option<ExportStatus>, ArchiveError> {
        self.shared.exports.ask(request, self.shared.clock.now())
    }

    /// Breaks off what is being exported: all is to end. What is recorded goes on.
    pub fn end_exports(&self) {
        self.shared.exports.end();
    }

    /// Signs exports' manifests from now on.
    pub fn sign_exports(&self, key: Arc<SigningKey>) {
        self.shared.sign_exports(key);
    }

    /// Takes an export back or removes it, however far it is; false where there is none of that id.
    ///
    /// # Errors
    /// When its files cannot be removed.
    pub fn remove_export(&self, id: &str) -> Result<bool, ArchiveError> {
        self.shared.exports.remove(id)
    }

    /// Closes what is open and ends the threads; within a second, whatever the disk does. Frames that still wait are
    /// written as far as there is time.
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.queue.close();
        let threads = self.shared.take_threads();
        if threads.is_empty() {
            return;
        }
        let have_ended = self.have_ended.lock().unwrap_or_else(PoisonError::into_inner);
        if have_ended.recv_timeout(STOP_TIME) == Err(RecvTimeoutError::Timeout) {
            tracing::error!("the disk does not answer: what is open is read on at the next start");
            return;
        }
        for thread in threads {
            if thread.join().is_err() {
                tracing::error!("a thread of the archive panicked");
            }
        }
        self.shared.switch_lanes_off();
    }
}

impl Drop for Archive {
    fn drop(&mut self) {
        self.stop();
    }
}
