//! The one thread that writes: frames of all cameras become segments, one file and one row each.
//!
//! A row is written only after what it says is on the disk: with the first frame, every [`SYNC_INTERVAL`] and at the
//! end. What fails pauses the camera that it met; everything is tried again after [`RETRY_INTERVAL`]. The database is
//! no reason to stop writing: files are found again without it.

use super::boundaries::{Boundaries, Format, Moment, Verdict};
use super::lane::{Lane, RecordingState};
use super::name::SegmentName;
use super::open_segment::OpenSegment;
use super::queue::{Job, Taken};
use super::shared::Shared;
use super::{ArchiveError, reconcile, retention};
use crate::media::EncodedFrame;
use crate::store::SegmentRecord;
use crate::telemetry::RecordingDrop;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Between two times at which a segment is made safe: what a power cut may cost.
pub(super) const SYNC_INTERVAL: Duration = Duration::from_secs(2);

/// After which a camera whose recording failed is tried again.
pub(super) const RETRY_INTERVAL: Duration = Duration::from_secs(5);

/// Between two looks at age and bytes while no segment begins.
const RETENTION_INTERVAL: Duration = Duration::from_secs(60);

/// Between two looks at what is due.
const TEND_INTERVAL: Duration = Duration::from_millis(200);

/// For which the queue is waited for; in real time, whatever the clock.
const PATIENCE: Duration = Duration::from_millis(50);

/// Time for frames that still wait when all is to end.
const FINISH_TIME: Duration = Duration::from_millis(300);

/// Rows that wait for the database; beyond it, their files are found at the next start.
const MAX_OWED_ROWS: usize = 1000;

/// More than a container adds to a frame, its header included.
const OVERHEAD_BYTES: u64 = 8192;

/// The writer's own state.
#[derive(Debug)]
pub(super) struct Writer {
    shared: Arc<Shared>,
    recordings: BTreeMap<CameraId, Recording>,
    /// Rows that the database did not take.
    owed: Vec<SegmentRecord>,
    next_tend: Duration,
    next_retention: Duration,
    next_retry: Duration,
}

/// One camera, as the writer has it.
#[derive(Debug)]
struct Recording {
    lane: Arc<Lane>,
    boundaries: Boundaries,
    open: Option<OpenSegment>,
    retry_at: Duration,
    /// Told already, so that a disk that stays full does not fill the log.
    told: Option<String>,
}

impl Writer {
    pub(super) fn new(shared: Arc<Shared>) -> Self {
        let now = shared.clock.monotonic();
        Self {
            shared,
            recordings: BTreeMap::new(),
            owed: Vec::new(),
            next_tend: now,
            next_retention: now,
            next_retry: now,
        }
    }

    /// Writes until the queue is closed, then closes what is open.
    pub(super) fn run(mut self) {
        let mut finish_at = None;
        loop {
            match self.shared.queue.take(PATIENCE) {
                Taken::Job(Job::Frame(lane, frame, at)) => {
                    let now = self.shared.clock.monotonic();
                    let is_closed = self.shared.queue.is_closed();
                    if is_closed && now > *finish_at.get_or_insert(now + FINISH_TIME) {
                        lane.count_dropped(RecordingDrop::Stopping);
                    } else {
                        self.take(&lane, &frame, at);
                    }
                    lane.settle();
                }
                Taken::Job(Job::End(lane)) => self.end(&lane, RecordingState::Off),
                Taken::Nothing => {}
                Taken::End => break,
            }
            let now = self.shared.clock.monotonic();
            if now >= self.next_tend {
                self.next_tend = now + TEND_INTERVAL;
                self.tend(now);
            }
        }
        let lanes: Vec<_> = self.recordings.values().map(|recording| Arc::clone(&recording.lane)).collect();
        for lane in lanes {
            self.end(&lane, RecordingState::Off);
        }
        self.pay();
        for record in &self.owed {
            tracing::warn!(
                path = record.path,
                "a segment is left without its row; it is found at the next start"
            );
        }
    }

    /// Takes a frame out of the queue.
    fn take(&mut self, lane: &Arc<Lane>, frame: &EncodedFrame, at: Timestamp) {
        if lane.is_paused() {
            lane.count_dropped(RecordingDrop::Paused);
            return;
        }
        if let Err(error) = self.record(lane, frame, at) {
            lane.count_dropped(RecordingDrop::Paused);
            self.pause(lane, &error);
        }
    }

    fn record(&mut self, lane: &Arc<Lane>, frame: &EncodedFrame, at: Timestamp) -> Result<(), ArchiveError> {
        let secs = self.shared.settings().segment_secs;
        let recording = self.recordings.entry(lane.camera().clone()).or_insert_with(|| Recording {
            lane: Arc::clone(lane),
            boundaries: Boundaries::new(secs),
            open: None,
            retry_at: Duration::ZERO,
            told: None,
        });
        let fits = recording.open.as_ref().is_none_or(|open| open.fits(&frame.format));
        let format = if fits { Format::Same } else { Format::Changed };
        recording.boundaries.set_segment_secs(secs);
        let (verdict, has_ended) = recording.boundaries.judge(Moment { at, is_key: frame.is_key, format });
        if has_ended {
            self.close(lane.camera())?;
            lane.set_state(RecordingState::WaitingForKey);
        }
        match verdict {
            Verdict::Append => self.append(lane, frame, at),
            Verdict::Begin => self.begin(lane, frame, at),
            Verdict::Drop(reason) => {
                lane.count_dropped(reason);
                Ok(())
            }
        }
    }

    fn append(&mut self, lane: &Arc<Lane>, frame: &EncodedFrame, at: Timestamp) -> Result<(), ArchiveError> {
        self.make_room(frame.len_bytes() as u64 + OVERHEAD_BYTES)?;
        let Some(open) = self.recordings.get_mut(lane.camera()).and_then(|recording| recording.open.as_mut())
        else {
            return Ok(());
        };
        let n_bytes = open.append(frame, at)?;
        lane.count_written(n_bytes);
        self.shared.add_kept(n_bytes);
        Ok(())
    }

    /// Begins a segment, unless something is recorded there.
    fn begin(&mut self, lane: &Arc<Lane>, frame: &EncodedFrame, at: Timestamp) -> Result<(), ArchiveError> {
        let camera = lane.camera().clone();
        let folder = reconcile::enter(&self.shared)?;
        self.check_free()?;
        let (before, after) = self.neighbours(&camera, at);
        retention::make_room(&self.shared, &folder, frame.len_bytes() as u64 + OVERHEAD_BYTES)?;
        let Some(recording) = self.recordings.get_mut(&camera) else { return Ok(()) };
        if let Some(before) = before.filter(|before| before.last_at >= at) {
            recording.boundaries.bar(before.first_at, before.last_at);
            lane.count_dropped(RecordingDrop::Overlap);
            return Ok(());
        }
        let name = SegmentName { camera: camera.clone(), first_at: at };
        self.shared.note_young(&name);
        let Some(mut open) = OpenSegment::begin(&folder, &name, frame, self.shared.clock.now())? else {
            recording.boundaries.bar(at, at);
            lane.count_dropped(RecordingDrop::Overlap);
            return Ok(());
        };
        open.synced_at = self.shared.clock.monotonic();
        recording.boundaries.begun(at, after.map(|after| after.first_at));
        recording.open = Some(open);
        recording.told = None;
        lane.set_state(RecordingState::Recording);
        self.append(lane, frame, at)?;
        self.sync(&camera)
    }

    /// The segments before and after an instant; none where the database does not say.
    fn neighbours(&self, camera: &CameraId, at: Timestamp) -> (Option<SegmentRecord>, Option<SegmentRecord>) {
        let Shared { runtime, store, .. } = &*self.shared;
        let found = runtime.block_on(async {
            Ok::<_, crate::store::StoreError>((
                store.segment_before(camera, at).await?,
                store.segment_after(camera, at).await?,
            ))
        });
        found.unwrap_or_else(|error| {
            tracing::warn!(%camera, %error, "a segment begins without knowing its neighbours");
            (None, None)
        })
    }

    fn make_room(&self, more: u64) -> Result<(), ArchiveError> {
        if self.shared.kept_bytes().saturating_add(more) <= self.shared.max_bytes() {
            return Ok(());
        }
        let folder = reconcile::enter(&self.shared)?;
        retention::make_room(&self.shared, &folder, more)
    }

    fn check_free(&self) -> Result<(), ArchiveError> {
        let folder = reconcile::enter(&self.shared)?;
        let path = folder.path();
        let free_mib = folder.free_bytes().map_err(ArchiveError::files("look at the disk of", path))? >> 20;
        let least_mib = u64::from(self.shared.settings().min_free_mib);
        if free_mib < least_mib {
            return Err(ArchiveError::NearlyFull { free_mib, least_mib, path: path.to_owned() });
        }
        Ok(())
    }

    /// Makes a camera's open segment safe, and its row say so.
    fn sync(&mut self, camera: &CameraId) -> Result<(), ArchiveError> {
        let clock = &self.shared.clock;
        let Some(open) = self.recordings.get_mut(camera).and_then(|recording| recording.open.as_mut()) else {
            return Ok(());
        };
        let began = clock.monotonic();
        let record = open.sync()?.clone();
        open.synced_at = clock.monotonic();
        self.shared.metrics.archive_sync.observe((open.synced_at.saturating_sub(began)).as_secs_f64());
        if let Err(error) = self.shared.put(&record) {
            tracing::warn!(%camera, %error, "a segment's row was not written; tried again");
        }
        Ok(())
    }

    /// Ends a camera's open segment, if there is one.
    fn close(&mut self, camera: &CameraId) -> Result<(), ArchiveError> {
        let Some(recording) = self.recordings.get_mut(camera) else { return Ok(()) };
        let Some(mut open) = recording.open.take() else { return Ok(()) };
        recording.boundaries.end();
        let synced = open.sync().map(|_record| ());
        if open.is_empty() {
            self.discard(&open);
            return synced;
        }
        let written_bytes = open.written_bytes();
        let record = open.into_closed();
        // What is not known to be on the disk is in no row either.
        self.shared.subtract_kept(written_bytes.saturating_sub(record.n_bytes));
        if record.n_frames > 0
            && let Err(error) = self.shared.put(&record)
        {
            tracing::warn!(%camera, %error, "a segment's last row was not written; tried again");
            if self.owed.len() < MAX_OWED_ROWS {
                self.owed.push(record);
            }
        }
        synced
    }

    /// Removes the file of a segment of which not one frame could be written: a full disk would otherwise get another
    /// such file with every try.
    fn discard(&self, open: &OpenSegment) {
        let Some(folder) = self.shared.folder() else { return };
        if let Err(error) = folder.remove(&open.name()) {
            tracing::warn!(%error, "an empty segment was left");
        }
    }

    /// Ends what is open of a camera whose recording stops.
    fn end(&mut self, lane: &Arc<Lane>, state: RecordingState) {
        if let Err(error) = self.close(lane.camera()) {
            tracing::warn!(camera = %lane.camera(), %error, "the end of a segment was not written");
        }
        self.recordings.remove(lane.camera());
        lane.set_state(state);
    }

    /// Stops recording a camera for a while.
    fn pause(&mut self, lane: &Arc<Lane>, error: &ArchiveError) {
        let reason = error.to_string();
        if let Err(error) = self.close(lane.camera()) {
            tracing::debug!(camera = %lane.camera(), %error, "the end of a segment was not written");
        }
        let retry_at = self.shared.clock.monotonic() + RETRY_INTERVAL;
        if let Some(recording) = self.recordings.get_mut(lane.camera()) {
            recording.boundaries.end();
            recording.retry_at = retry_at;
            if recording.told.as_ref() != Some(&reason) {
                tracing::error!(camera = %lane.camera(), reason, "recording is paused");
                recording.told = Some(reason);
            }
        }
        lane.set_state(RecordingState::Paused { reason: error.without_places() });
    }

    /// Does what is due.
    fn tend(&mut self, now: Duration) {
        let is_due = |recording: &Recording| {
            let open = recording.open.as_ref();
            open.is_some_and(|open| open.is_ahead() && now.saturating_sub(open.synced_at) >= SYNC_INTERVAL)
        };
        let due: Vec<_> =
            self.recordings.values().filter(|r| is_due(r)).map(|r| Arc::clone(&r.lane)).collect();
        for lane in due {
            if let Err(error) = self.check_free().and_then(|()| self.sync(lane.camera())) {
                self.pause(&lane, &error);
            }
        }
        self.resume(now);
        if now >= self.next_retry {
            self.next_retry = now + RETRY_INTERVAL;
            self.pay();
        }
        if now >= self.next_retention {
            self.next_retention = now + RETENTION_INTERVAL;
            self.retain();
        }
    }

    /// Lets paused cameras try again whose time has come.
    fn resume(&mut self, now: Duration) {
        let is_waiting = |recording: &&mut Recording| recording.lane.is_paused() && now >= recording.retry_at;
        let waiting: Vec<_> =
            self.recordings.values_mut().filter(is_waiting).map(|r| Arc::clone(&r.lane)).collect();
        for lane in waiting {
            match self.check_free() {
                Ok(()) => lane.set_state(RecordingState::WaitingForKey),
                Err(error) => self.pause(&lane, &error),
            }
        }
    }

    /// Writes the rows that the database did not take.
    fn pay(&mut self) {
        let shared = &self.shared;
        self.owed.retain(|record| match shared.put(record) {
            Ok(()) => false,
            Err(error) => {
                tracing::debug!(%error, path = record.path, "a segment's row still waits");
                true
            }
        });
    }

    fn retain(&self) {
        let Some(folder) = self.shared.folder() else { return };
        let done = retention::finish_removals(&self.shared, &folder)
            .and_then(|_n_removed| retention::make_room(&self.shared, &folder, 0));
        match done {
            // What is being written is more than may be: whoever writes on is paused.
            Ok(()) | Err(ArchiveError::NoRoom { .. }) => {}
            Err(error) => tracing::warn!(%error, "old segments were not removed"),
        }
    }
}
