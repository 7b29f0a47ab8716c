//! Frames recorded, read back, and kept within bounds.

use super::*;
use crate::media::{Decoder, EncodedFrame, EncodedQueue, Input, TICK_NANOS, Times};
use crate::store::SegmentState;
use crate::telemetry::RecordingDrop;
use gst::prelude::*;
use gstreamer as gst;
use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;
use std::io::{Cursor, Read};
use videofields_vision::clock::SimulatedClock;

pub(super) const SECOND: i64 = 1_000_000_000;

/// Settings of a property test: the same cases in every run, and nothing written beside the tests.
pub(super) fn seeded(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(2004);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Frames of a test picture at 20 a second, a key frame every ten.
pub(super) fn frames(encoder: &str, n: u32) -> Vec<EncodedFrame> {
    gst::init().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("video.mkv");
    let text = format!(
        "videotestsrc num-buffers={n} pattern=ball ! video/x-raw,format=I420,width=160,height=120,framerate=20/1 ! \
         {encoder} ! matroskamux ! filesink location={}",
        path.display()
    );
    let pipeline = gst::parse::launch(&text).unwrap();
    pipeline.set_state(gst::State::Playing).unwrap();
    let ends = [gst::MessageType::Eos, gst::MessageType::Error];
    let end = pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends);
    assert!(matches!(end.unwrap().view(), gst::MessageView::Eos(_)), "{text}");
    pipeline.set_state(gst::State::Null).unwrap();
    let queue = Arc::new(EncodedQueue::new(1 << 24));
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
    while !decoder.has_ended() {
        drop(decoder.pull(Duration::from_millis(50)));
        assert!(decoder.fault().is_none());
    }
    std::iter::from_fn(|| queue.take()).collect()
}

fn h264(n: u32) -> Vec<EncodedFrame> {
    frames("x264enc bframes=2 key-int-max=10 tune=0", n)
}

/// The instant of a frame in a stream that begins at `start`.
fn instant(start: i64, frame: &EncodedFrame, first: &EncodedFrame) -> Timestamp {
    let nanos = frame.stream_nanos.unwrap() - first.stream_nanos.unwrap();
    Timestamp::from_nanos(start + (nanos + TICK_NANOS / 2).div_euclid(TICK_NANOS) * TICK_NANOS)
}

pub(super) fn north() -> CameraId {
    CameraId::new("north").unwrap()
}

pub(super) fn at(nanos: i64) -> Timestamp {
    Timestamp::from_nanos(nanos)
}

pub(super) struct Stage {
    place: tempfile::TempDir,
    pub(super) clock: Arc<SimulatedClock>,
    pub(super) settings: ArchiveSettings,
    pub(super) store: Store,
    metrics: Arc<Metrics>,
}

impl Stage {
    pub(super) async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("a.sqlite")).await.unwrap();
        let settings = ArchiveSettings {
            folder: folder.path().join("archive"),
            segment_secs: 5,
            min_free_mib: 0,
            ..ArchiveSettings::default()
        };
        let clock = Arc::new(SimulatedClock::new(at(1000 * SECOND)));
        Self { place: folder, clock, settings, store, metrics: Arc::new(Metrics::new()) }
    }

    pub(super) async fn archive(&self) -> Archive {
        let clock = Arc::clone(&self.clock) as Arc<dyn Clock>;
        Archive::start(self.settings.clone(), self.store.clone(), Arc::clone(&self.metrics), clock)
            .await
            .unwrap()
    }

    /// Records and closes; waits in real time alone.
    pub(super) async fn record(&self, start: i64, frames: &[EncodedFrame]) {
        let archive = self.archive().await;
        let mut recorder = archive.recorder(&north());
        for frame in frames {
            recorder.push(frame, instant(start, frame, &frames[0]));
        }
        drop(recorder);
        archive.stop();
        let status = archive.status();
        assert_eq!(status.cameras[0].state, RecordingState::Off);
    }

    pub(super) async fn rows(&self) -> Vec<SegmentRecord> {
        self.store.segments(&north(), at(i64::MIN), at(i64::MAX)).await.unwrap()
    }

    pub(super) fn path(&self, record: &SegmentRecord) -> std::path::PathBuf {
        self.settings.folder.join(&record.path)
    }
}

/// What a decoder gives of an input: times and sums of luma.
pub(super) fn decoded(input: Input, times: Times) -> Vec<(i64, u64)> {
    let mut decoder = Decoder::start(input.with_times(times), None).unwrap();
    let mut seen = Vec::new();
    while !decoder.has_ended() {
        if let Some(picture) = decoder.pull(Duration::from_millis(50)) {
            let luma = picture.image.plane(0);
            let sum = (0..luma.height).flat_map(|y| luma.row(y)).map(|luma| u64::from(*luma)).sum();
            seen.push((picture.stream_nanos.unwrap(), sum));
        }
        assert!(decoder.fault().is_none());
    }
    seen
}

/// Pictures that are shown before the key frame that they follow in the file.
pub(super) const OPEN_GROUPS: &str = "x265enc key-int-max=10 ! h265parse";

#[tokio::test(flavor = "multi_thread")]
async fn pictures_shown_before_their_key_frame_shift_nothing() {
    let stage = Stage::new().await;
    stage.record(0, &frames(OPEN_GROUPS, 60)).await;
    let archive = stage.archive().await;
    let whole = archive.open_at(&north(), at(0)).await.unwrap().unwrap();
    let all = decoded(Input::stream(whole), Times::Written);
    assert_eq!(all.len(), 60);
    for i in 0..60 {
        let reading = archive.open_at(&north(), at(i * SECOND / 20)).await.unwrap().unwrap();
        let key = i / 10 * 10;
        assert_eq!(reading.starts_at(), at(key * SECOND / 20));
        let part = decoded(Input::stream(reading), Times::Written);
        let part: Vec<_> = part.into_iter().filter(|(nanos, _)| *nanos >= key * SECOND / 20).collect();
        assert_eq!(part, all[key as usize..], "frame {i}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_recorded_is_decoded_from_any_instant_with_its_time() {
    for encoder in [
        "x264enc bframes=2 key-int-max=10 tune=0",
        "x264enc tune=zerolatency key-int-max=10",
        "jpegenc",
        "vp8enc deadline=1 keyframe-max-dist=10",
    ] {
        let stage = Stage::new().await;
        let frames = frames(encoder, 110);
        assert_eq!(frames.len(), 110);
        let start = 500 * SECOND + 3 * TICK_NANOS;
        stage.record(start, &frames).await;
        let rows = stage.rows().await;
        assert_eq!(rows.len(), 2, "{encoder}: {rows:#?}");
        assert_eq!(rows.iter().map(|row| row.n_frames).collect::<Vec<_>>(), [100, 10], "{encoder}");
        assert!(rows.iter().all(|row| row.state == SegmentState::Closed && row.size_px == (160, 120)));
        assert_eq!((rows[0].first_at, rows[0].last_at), (at(start), at(start + 99 * SECOND / 20)));
        assert_eq!(rows[1].first_at, at(start + 5 * SECOND));
        for row in &rows {
            assert_eq!(std::fs::metadata(stage.path(row)).unwrap().len(), row.n_bytes, "all bytes are whole");
        }

        let archive = stage.archive().await;
        let whole = archive.open_at(&north(), at(start)).await.unwrap().unwrap();
        let all = decoded(Input::stream(whole), Times::Written);
        let times: Vec<_> = all.iter().map(|(nanos, _)| *nanos).collect();
        assert_eq!(times, (0..100).map(|i| i * SECOND / 20).collect::<Vec<_>>(), "{encoder}");
        // A frame before each key frame, on it, and after it. What is read as a stream begins at 0 wherever it begins.
        for i in [9, 10, 11, 45, 90, 99] {
            let reading = archive.open_at(&north(), at(start + i * SECOND / 20)).await.unwrap().unwrap();
            let key = if encoder == "jpegenc" { i } else { i / 10 * 10 };
            assert_eq!(reading.starts_at(), at(start + key * SECOND / 20), "{encoder}: {i}");
            assert_eq!((reading.segment().first_at, reading.last_at()), (at(start), rows[0].last_at));
            let part = decoded(Input::stream(reading), Times::Written);
            // What is shown before the key frame is nobody's.
            let part: Vec<_> = part.into_iter().filter(|(nanos, _)| *nanos >= key * SECOND / 20).collect();
            assert_eq!(part, all[key as usize..], "{encoder}: frame {i}");
        }
        assert!(archive.open_at(&north(), at(start - 1)).await.unwrap().is_none());
        let last = archive.open_at(&north(), at(start + 900 * SECOND)).await.unwrap().unwrap();
        assert_eq!(last.segment().first_at, at(start + 5 * SECOND));
        let next = archive.next_segment(&north(), at(start)).await.unwrap().unwrap();
        assert_eq!(next, SegmentRecord { keys: next.keys.clone(), ..rows[1].clone() });
        assert_eq!(archive.next_segment(&north(), next.first_at).await.unwrap(), None);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn gaps_lie_between_segments_and_nothing_is_recorded_twice() {
    let stage = Stage::new().await;
    let frames = h264(40);
    stage.record(100 * SECOND, &frames).await;
    stage.record(110 * SECOND, &frames).await;
    let spans = async || -> Vec<(i64, i64)> {
        let seen = stage.rows().await;
        seen.iter().map(|row| (row.first_at.as_nanos(), row.last_at.as_nanos())).collect()
    };
    let last = 39 * SECOND / 20;
    let expected = [(100 * SECOND, 100 * SECOND + last), (110 * SECOND, 110 * SECOND + last)];
    assert_eq!(spans().await, expected);
    // The same again, and what begins before it and runs into it: each ends where something is there already.
    stage.record(110 * SECOND, &frames).await;
    assert_eq!(spans().await, expected);
    stage.record(109 * SECOND, &frames).await;
    let ends = 109 * SECOND + 19 * SECOND / 20;
    assert_eq!(spans().await, [expected[0], (109 * SECOND, ends), expected[1]]);

    let archive = stage.archive().await;
    let found = async |from: i64, to: i64| {
        let found = archive.segments(&north(), at(from * SECOND), at(to * SECOND)).await.unwrap();
        found.iter().map(|row| row.first_at.as_nanos() / SECOND).collect::<Vec<_>>()
    };
    assert_eq!(found(0, 99).await, Vec::<i64>::new());
    assert_eq!(found(0, 100).await, [100]);
    assert_eq!(found(101, 109).await, [100, 109]);
    assert_eq!(found(102, 108).await, Vec::<i64>::new());
    assert_eq!(found(110, 900).await, [110]);
    assert_eq!(archive.segments(&CameraId::new("south").unwrap(), at(0), at(i64::MAX)).await.unwrap(), []);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_format_begins_another_segment() {
    let stage = Stage::new().await;
    let archive = stage.archive().await;
    let mut recorder = archive.recorder(&north());
    let (one, other) = (h264(20), frames("jpegenc", 20));
    for (start, frames) in [(0, &one), (SECOND, &other)] {
        for frame in frames {
            recorder.push(frame, instant(start, frame, &frames[0]));
        }
    }
    drop(recorder);
    archive.stop();
    let rows = stage.rows().await;
    let codecs: Vec<_> = rows.iter().map(|row| (row.codec.as_str(), row.n_frames)).collect();
    assert_eq!(codecs, [("video/x-h264", 20), ("image/jpeg", 20)]);
    assert_eq!(archive.status().cameras[0].n_frames, 40);
    let text = stage.metrics.encode();
    assert!(text.contains("videofields_archive_frames_total{camera=\"north\"} 40"), "{text}");
}

/// Waits, in real time, for what a thread does.
fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let clock = videofields_vision::clock::SystemClock::new();
    while !is_so() {
        assert!(clock.monotonic() < Duration::from_secs(30), "waited for {what}");
        clock.sleep(Duration::from_millis(2));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_camera_that_cannot_be_recorded_pauses_and_goes_on_by_itself() {
    let stage = Stage::new().await;
    let archive = stage.archive().await;
    // Not even root makes folders in a file.
    std::fs::write(stage.settings.folder.join("north"), b"in the way").unwrap();
    let mut recorder = archive.recorder(&north());
    let mut other = archive.recorder(&CameraId::new("south").unwrap());
    let frames = h264(20);
    let mut turn = 0;
    let mut push = |recorder: &mut Recorder| {
        turn += 1;
        for frame in &frames {
            recorder.push(frame, instant(turn * SECOND, frame, &frames[0]));
        }
    };
    push(&mut recorder);
    let state = || archive.status().cameras[0].state.clone();
    wait_for("the pause", || matches!(state(), RecordingState::Paused { .. }));
    let RecordingState::Paused { reason } = state() else { panic!("paused") };
    assert!(reason.starts_with("cannot make: "), "{reason}");
    push(&mut other);
    wait_for("the other camera", || archive.status().cameras[1].n_frames == 20);
    assert_eq!(archive.status().cameras[1].state, RecordingState::Recording);
    std::fs::remove_file(stage.settings.folder.join("north")).unwrap();
    push(&mut recorder);
    assert!(matches!(state(), RecordingState::Paused { .. }), "the clock stands still");
    stage.clock.advance(writer::RETRY_INTERVAL);
    wait_for("another try", || state() == RecordingState::WaitingForKey);
    push(&mut recorder);
    wait_for("the recording", || archive.status().cameras[0].n_frames == 20);
    assert_eq!(state(), RecordingState::Recording);
    let dropped = archive.status().cameras[0].dropped;
    assert!(dropped.contains(&(RecordingDrop::Paused, 40)), "{dropped:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_disk_that_is_nearly_full_or_a_folder_that_cannot_be_made_records_nothing_and_says_why() {
    for (min_free_mib, is_blocked, expected) in
        [(1 << 30, false, "archive.min_free_mib is 1073741824"), (0, true, "cannot record into: ")]
    {
        let mut stage = Stage::new().await;
        stage.settings.min_free_mib = min_free_mib;
        if is_blocked {
            std::fs::write(&stage.settings.folder, b"in the way").unwrap();
        }
        let archive = stage.archive().await;
        let mut recorder = archive.recorder(&north());
        let frames = h264(20);
        for frame in &frames {
            recorder.push(frame, instant(0, frame, &frames[0]));
        }
        let reason = || match archive.status().cameras[0].state.clone() {
            RecordingState::Paused { reason } => reason,
            _ => String::new(),
        };
        wait_for("the pause", || reason().contains(expected));
        assert!(stage.metrics.encode().contains("videofields_archive_paused{camera=\"north\"} 1"));
        if is_blocked {
            std::fs::remove_file(&stage.settings.folder).unwrap();
            stage.clock.advance(writer::RETRY_INTERVAL);
            wait_for("another try", || reason().is_empty());
            for frame in &frames {
                recorder.push(frame, instant(SECOND, frame, &frames[0]));
            }
            wait_for("the recording", || archive.status().cameras[0].n_frames == 20);
        } else {
            assert_eq!(stage.rows().await, []);
            assert_eq!(std::fs::read_dir(&stage.settings.folder).unwrap().count(), 0);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_bytes_that_are_kept_never_pass_their_bound_and_the_oldest_go_first() {
    let mut stage = Stage::new().await;
    let frames = frames("jpegenc", 110);
    let size: usize = frames.iter().map(EncodedFrame::len_bytes).sum();
    let max_bytes = size as u64 * 3;
    stage.settings.max_gib = max_bytes as f64 / f64::from(1 << 30);
    let archive = stage.archive().await;
    let cameras = ["a", "b"].map(|id| CameraId::new(id).unwrap());
    let mut recorders = cameras.clone().map(|camera| archive.recorder(&camera));
    for turn in 0..6 {
        for frame in &frames {
            for recorder in &mut recorders {
                recorder.push(frame, instant(turn * 10 * SECOND, frame, &frames[0]));
            }
            assert!(archive.status().kept_bytes <= max_bytes);
        }
        wait_for("the frames", || {
            let status = archive.status();
            assert!(status.kept_bytes <= max_bytes, "{status:?}");
            status.cameras.iter().all(|camera| camera.n_frames == (turn as u64 + 1) * 110)
        });
    }
    drop(recorders);
    archive.stop();
    let mut kept = Vec::new();
    for camera in &cameras {
        kept.extend(stage.store.segments(camera, at(i64::MIN), at(i64::MAX)).await.unwrap());
    }
    let bytes: u64 = kept.iter().map(|row| std::fs::metadata(stage.path(row)).unwrap().len()).sum();
    assert!(bytes <= max_bytes && bytes == archive.status().kept_bytes, "{bytes} of {max_bytes}");
    assert!(bytes > max_bytes / 2, "no more goes than must: {bytes} of {max_bytes}");
    // Two segments a turn and camera: the newest are there, without a hole.
    for camera in &cameras {
        let times: Vec<_> = kept.iter().filter(|row| row.camera == *camera).map(|row| row.first_at).collect();
        let all: Vec<_> =
            (0..6).flat_map(|turn| [turn * 10, turn * 10 + 5]).map(|secs| at(secs * SECOND)).collect();
        assert!(!times.is_empty() && all.ends_with(&times), "{camera}: {times:?}");
    }
    assert!(stage.metrics.encode().contains("videofields_archive_segments_removed_total{reason=\"bytes\"}"));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_too_old_goes_within_a_minute() {
    let mut stage = Stage::new().await;
    stage.settings.max_age_days = 0.5;
    let frames = h264(20);
    stage.record(0, &frames).await;
    stage.record(3600 * SECOND, &frames).await;
    let archive = stage.archive().await;
    assert_eq!(stage.rows().await.len(), 2);
    // The clock began at 1000 s.
    stage.clock.advance(Duration::from_secs(43_200));
    wait_for("retention", || {
        archive.status().kept_bytes < 20_000 && stage.clock.monotonic() > Duration::ZERO
    });
    let rows = async || stage.rows().await.iter().map(|row| row.first_at).collect::<Vec<_>>();
    for _ in 0..500 {
        if rows().await.len() == 1 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(rows().await, [at(3600 * SECOND)]);
}

#[tokio::test(flavor = "multi_thread")]
async fn times_to_come_push_out_nothing_and_grow_old_like_all_else() {
    let mut stage = Stage::new().await;
    let frames = frames("jpegenc", 60);
    let far = 4_102_444_800 * SECOND;
    for start in [far, far + 10 * SECOND] {
        stage.record(start, &frames).await;
    }
    let n_bytes: u64 = stage.rows().await.iter().map(|row| row.n_bytes).sum();
    // Three of them, and not four.
    stage.settings.max_gib = n_bytes as f64 * 1.8 / f64::from(1 << 30);
    for start in [0, 10 * SECOND] {
        stage.clock.advance(Duration::from_secs(60));
        stage.record(start, &frames).await;
    }
    let starts = async || stage.rows().await.iter().map(|row| row.first_at.as_nanos()).collect::<Vec<_>>();
    assert_eq!(starts().await, [0, 10 * SECOND, far + 10 * SECOND], "what was written first");

    stage.settings.max_age_days = 0.5;
    stage.clock.advance(Duration::from_secs(43_200));
    let archive = stage.archive().await;
    for _ in 0..500 {
        if stage.rows().await.is_empty() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(stage.rows().await, []);
    archive.stop();
}

#[tokio::test(flavor = "multi_thread")]
async fn removals_that_were_broken_off_are_finished_and_nothing_else_goes() {
    let stage = Stage::new().await;
    let frames = h264(20);
    for start in [0, 100, 200] {
        stage.record(start * SECOND, &frames).await;
    }
    let rows = stage.rows().await;
    // Broken off after the mark, and after the file was removed.
    for row in &rows[..2] {
        assert!(stage.store.mark_segment_deleting(row.id).await.unwrap());
    }
    std::fs::remove_file(stage.path(&rows[1])).unwrap();
    let note = stage.settings.folder.join("north/1970-01-01/note.txt");
    std::fs::write(&note, b"mine").unwrap();
    let archive = stage.archive().await;
    assert_eq!(archive.status().reconciled.n_removed, 2);
    assert_eq!(stage.rows().await, [rows[2].clone()]);
    assert!(!stage.path(&rows[0]).try_exists().unwrap());
    assert_eq!(archive.status().kept_bytes, rows[2].n_bytes);
    assert_eq!(std::fs::read(&note).unwrap(), b"mine");
}

/// Waits until every row and file was looked at.
fn survey_is_done(archive: &Archive) -> Reconciled {
    wait_for("the survey", || archive.status().reconciled.is_done);
    archive.status().reconciled
}

#[tokio::test(flavor = "multi_thread")]
async fn files_and_rows_find_each_other_again() {
    let mut stage = Stage::new().await;
    let frames = h264(40);
    for start in [0, 100, 200] {
        stage.record(start * SECOND, &frames).await;
    }
    let rows = stage.rows().await;
    // A file alone tells when it was written last.
    let plain = |row: &SegmentRecord| SegmentRecord { id: 0, written_at: at(0), ..row.clone() };
    let expected: Vec<_> = rows.iter().map(plain).collect();

    // A new database: every file is adopted, but for one that cannot be read.
    stage.store = Store::open(&stage.place.path().join("b.sqlite")).await.unwrap();
    let junk = "north/1970-01-01/000050.000000000Z.mkv";
    std::fs::write(stage.settings.folder.join(junk), b"not Matroska").unwrap();
    let archive = stage.archive().await;
    let done = survey_is_done(&archive);
    assert_eq!((done.n_adopted, done.n_quarantined, done.n_missing), (3, 1, 0));
    assert_eq!(stage.rows().await.iter().map(plain).collect::<Vec<_>>(), expected);
    let aside = stage.settings.folder.join("quarantine/north-1970-01-01-000050.000000000Z.mkv");
    assert_eq!(std::fs::read(aside).unwrap(), b"not Matroska");
    let kept_bytes = expected.iter().map(|row| row.n_bytes).sum::<u64>();
    assert_eq!(archive.status().kept_bytes, kept_bytes);
    drop(archive);

    // A file goes, and comes back.
    let away = stage.place.path().join("away");
    std::fs::rename(stage.path(&rows[1]), &away).unwrap();
    let archive = stage.archive().await;
    assert_eq!(survey_is_done(&archive).n_missing, 1);
    assert_eq!(stage.rows().await.len(), 2);
    assert_eq!(archive.status().kept_bytes, kept_bytes - rows[1].n_bytes);
    drop(archive);
    std::fs::rename(&away, stage.path(&rows[1])).unwrap();
    let archive = stage.archive().await;
    assert_eq!(survey_is_done(&archive).n_back, 1);
    assert_eq!(stage.rows().await.iter().map(plain).collect::<Vec<_>>(), expected);
    drop(archive);

    // A file that lost its end: the row says what is left.
    let file = std::fs::File::options().write(true).open(stage.path(&rows[2])).unwrap();
    file.set_len(rows[2].n_bytes - 1).unwrap();
    let archive = stage.archive().await;
    assert_eq!(survey_is_done(&archive).n_shortened, 1);
    let shortened = stage.rows().await.remove(2);
    assert_eq!((shortened.n_frames, shortened.state), (39, SegmentState::Closed));
    assert_eq!(archive.status().kept_bytes, kept_bytes - rows[2].n_bytes + shortened.n_bytes);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_cut_anywhere_is_kept_up_to_its_last_whole_frame() {
    let stage = Stage::new().await;
    let frames = h264(30);
    stage.record(0, &frames).await;
    let whole = stage.rows().await.remove(0);
    let bytes = std::fs::read(stage.path(&whole)).unwrap();
    let keyed = stage.store.segment_at_path(&whole.path).await.unwrap().unwrap();
    let mut last = 0;
    for (turn, end) in (0..bytes.len()).step_by(97).enumerate() {
        let mut stage = Stage::new().await;
        stage.settings.folder = stage.place.path().join(format!("{turn}"));
        let path = stage.path(&whole);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &bytes[..end]).unwrap();
        if turn % 2 == 1 {
            // As if it had been open, with a row of its first frames alone, or of more than there is.
            let row = SegmentRecord { state: SegmentState::Open, ..keyed.clone() };
            stage.store.put_segment(&row).await.unwrap();
        }
        let (settings, store, clock) =
            (stage.settings.clone(), stage.store.clone(), Arc::clone(&stage.clock));
        let repaired = tokio::task::spawn_blocking(move || repair(&settings, &store, clock)).await.unwrap();
        let done = repaired.unwrap();
        let rows = stage.rows().await;
        if rows.is_empty() {
            assert_eq!((done.n_quarantined, last), (1, 0), "{end}: {done:?}");
            continue;
        }
        assert_eq!((rows.len(), done.n_quarantined), (1, 0), "{end}");
        assert!(rows[0].n_frames >= last && rows[0].n_bytes <= end as u64, "{end}: {rows:?}");
        last = rows[0].n_frames;
        let checked = tokio::task::spawn_blocking({
            let (settings, store) = (stage.settings.clone(), stage.store.clone());
            move || check(&settings, &store)
        });
        let checked = checked.await.unwrap().unwrap();
        assert_eq!((checked.faults.as_slice(), checked.n_frames), ([].as_slice(), last), "{end}");
        if turn % 10 == 0 {
            let folder = folder::Folder::look(&stage.settings.folder).unwrap();
            let row = stage.store.segment_at_path(&whole.path).await.unwrap().unwrap();
            let reading = Reading::open(&folder, row, at(0)).unwrap();
            assert_eq!(decoded(Input::stream(reading), Times::Written).len() as u64, last, "{end}");
        }
    }
    assert!(last >= 28, "{last}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_segment_is_read_as_far_as_it_is_written_and_told_as_far_as_it_is_safe() {
    let stage = Stage::new().await;
    let archive = stage.archive().await;
    let mut recorder = archive.recorder(&north());
    let frames = h264(60);
    for frame in &frames {
        recorder.push(frame, instant(0, frame, &frames[0]));
    }
    wait_for("the frames", || archive.status().cameras[0].n_frames == 60);
    let mut reading = archive.open_at(&north(), at(0)).await.unwrap().unwrap();
    assert_eq!((reading.segment().state, reading.segment().n_frames), (SegmentState::Open, 1));
    let mut bytes = Vec::new();
    reading.read_to_end(&mut bytes).unwrap();
    assert_eq!(decoded(Input::stream(Cursor::new(bytes.clone())), Times::Written).len(), 60);
    // Whoever reads while it is written may find half a block at its end; that costs this block alone.
    for n_missing in [1, 2, 7, 30, bytes.len() / 3] {
        let cut = bytes[..bytes.len() - n_missing].to_vec();
        let n_seen = decoded(Input::stream(Cursor::new(cut)), Times::Written).len();
        assert!(n_seen < 60 && (n_missing > 30 || n_seen >= 57), "{n_missing}: {n_seen}");
    }
    stage.clock.advance(writer::SYNC_INTERVAL);
    for _ in 0..1000 {
        let reading = archive.open_at(&north(), at(0)).await.unwrap().unwrap();
        if reading.segment().n_frames == 60 {
            assert_eq!(decoded(Input::stream(reading), Times::Written).len(), 60);
            return;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    panic!("the segment was not made safe");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_leaves_out_whole_groups() {
    let lane = Arc::new(lane::Lane::new(north(), Arc::new(Metrics::new())));
    let frames = h264(30);
    let size = frames[0].len_bytes();
    let queue = queue::Queue::new(2 * (size + 512));
    let push = |frame: &EncodedFrame| queue.push(queue::Job::Frame(Arc::clone(&lane), frame.clone(), at(0)));
    assert!(push(&frames[0]) && push(&frames[0]) && !push(&frames[0]));
    assert!(queue.push(queue::Job::End(Arc::clone(&lane))), "an end always fits");
    assert!(matches!(queue.take(Duration::ZERO), queue::Taken::Job(queue::Job::Frame(..))));
    assert!(push(&frames[0]) && !push(&frames[0]));
    queue.close();
    for _ in 0..3 {
        assert!(matches!(queue.take(Duration::ZERO), queue::Taken::Job(_)));
    }
    assert!(matches!(queue.take(Duration::ZERO), queue::Taken::End) && !push(&frames[0]));
}
