//! Recordings as a machine meets them: killed at any moment, on a full disk, and checked from the command line.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use gstreamer as gst;
use gstreamer::prelude::*;
use sqlx::{Connection, SqliteConnection};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_recording::archive::{Archive, RecordingState, check, repair};
use videofields_recording::media::{Decoder, EncodedFrame, EncodedQueue, Input, TICK_NANOS};
use videofields_recording::store::{AuditEntry, SegmentRecord, Store};
use videofields_recording::telemetry::Metrics;
use videofields_recording::timeline::Replay;
use videofields_testing::small_disk::SmallDisk;
use videofields_testing::{say_skipped, wait_for};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::ArchiveSettings;
use videofields_vision::frame::CameraId;

const SECOND: i64 = 1_000_000_000;

const CAMERAS: [&str; 4] = ["north", "east", "south", "west"];

/// Scene time between two lives of the process that is killed.
const LIFE_NANOS: i64 = 10_000 * SECOND;

/// Names the folder into which this process records until it is killed.
const CHILD: &str = "VIDEOFIELDS_TEST_RECORDS_INTO";

/// Frames from one key frame of the test video to the next: a fragment.
const GROUP: usize = 10;

fn say(line: &str) {
    let mut stdout = std::io::stdout();
    writeln!(stdout, "{line}").and_then(|()| stdout.flush()).unwrap();
}

fn settings(folder: &Path) -> ArchiveSettings {
    ArchiveSettings {
        folder: folder.join("archive"),
        segment_secs: 5,
        min_free_mib: 0,
        ..ArchiveSettings::default()
    }
}

/// About now: what is long past would go for its age.
fn now() -> i64 {
    SystemClock::new().now().as_nanos() / SECOND * SECOND
}

fn camera(id: &str) -> CameraId {
    CameraId::new(id).unwrap()
}

/// Two seconds of a test picture, B-frames included, a key frame every half second.
fn frames(folder: &Path) -> Vec<EncodedFrame> {
    gst::init().unwrap();
    let path = folder.join("video.mkv");
    if !path.try_exists().unwrap() {
        let text = format!(
            "videotestsrc num-buffers=40 pattern=snow ! video/x-raw,format=I420,width=160,height=120,framerate=20/1 ! \
             x264enc bframes=2 key-int-max=10 tune=0 bitrate=400 ! matroskamux ! filesink location={}",
            path.display()
        );
        let pipeline = gst::parse::launch(&text).unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let ends = [gst::MessageType::Eos, gst::MessageType::Error];
        let end = pipeline.bus().unwrap().timed_pop_filtered(gst::ClockTime::from_seconds(60), &ends);
        assert!(matches!(end.unwrap().view(), gst::MessageView::Eos(_)), "{text}");
        pipeline.set_state(gst::State::Null).unwrap();
    }
    let queue = Arc::new(EncodedQueue::new(1 << 24));
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
    while !decoder.has_ended() {
        drop(decoder.pull(Duration::from_millis(50)));
        assert!(decoder.fault().is_none());
    }
    std::iter::from_fn(|| queue.take()).collect()
}

/// The instant of a frame when the video is shown for the `turn`-th time.
fn instant(start: i64, turn: i64, frame: &EncodedFrame, first: &EncodedFrame) -> Timestamp {
    let nanos = frame.stream_nanos.unwrap() - first.stream_nanos.unwrap();
    Timestamp::from_nanos(
        start + turn * 2 * SECOND + (nanos + TICK_NANOS / 2).div_euclid(TICK_NANOS) * TICK_NANOS,
    )
}

async fn open(folder: &Path) -> (Store, Archive) {
    let store = Store::open(&folder.join("a.sqlite")).await.unwrap();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let archive =
        Archive::start(settings(folder), store.clone(), Arc::new(Metrics::new()), clock).await.unwrap();
    (store, archive)
}

async fn rows(store: &Store, camera: &CameraId) -> Vec<SegmentRecord> {
    let (from, to) = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
    store.segments(camera, from, to).await.unwrap()
}

/// Pictures that a decoder gives of a reading.
fn n_decoded(input: Input) -> u64 {
    let mut decoder = Decoder::start(input, None).unwrap();
    let mut n = 0;
    while !decoder.has_ended() {
        n += u64::from(decoder.pull(Duration::from_millis(50)).is_some());
        assert!(decoder.fault().is_none());
    }
    n
}

/// Records four cameras at the pace at which they see, each a little behind the one before, and says every frame. Between
/// every second of it lies a gap, so that segments end and begin sixty times as often as they usually do.
async fn record_until_killed(folder: &Path) {
    let frames = frames(folder);
    let (store, archive) = open(folder).await;
    let mut recorders = CAMERAS.map(|id| archive.recorder(&camera(id)));
    let mut newest = now();
    for id in CAMERAS {
        newest =
            rows(&store, &camera(id)).await.last().map_or(newest, |row| row.last_at.as_nanos().max(newest));
    }
    let start = (newest / LIFE_NANOS + 1) * LIFE_NANOS;
    let clock = SystemClock::new();
    for tick in 0..1200 {
        for (idx, recorder) in recorders.iter_mut().enumerate() {
            let Some(number) = (tick as usize).checked_sub(3 * idx) else { continue };
            let frame = &frames[number % frames.len()];
            let gaps = (number / (2 * GROUP)) as i64 * 10 * SECOND;
            recorder.push(frame, instant(start + gaps, 0, frame, &frames[0]));
            say(&format!("pushed {idx}"));
        }
        let status = archive.status();
        for (idx, id) in CAMERAS.iter().enumerate() {
            let written = status.cameras.iter().find(|recording| recording.camera.as_str() == *id);
            say(&format!("written {idx} {}", written.map_or(0, |recording| recording.n_frames)));
        }
        let due = Duration::from_millis(50) * (tick + 1);
        clock.sleep(due.saturating_sub(clock.monotonic()));
    }
}

/// A small generator of the same numbers in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, most: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % most
    }
}

/// What a killed process had done for a camera.
#[derive(Clone, Copy, Debug, Default)]
struct Said {
    n_pushed: u64,
    n_written: u64,
}

/// What the killed runs cost.
#[derive(Debug, Default)]
struct Cost {
    opened: Duration,
    n_lost: u64,
}

#[tokio::test(flavor = "multi_thread")]
async fn a_daemon_that_is_killed_at_any_moment_loses_a_fragment_at_most() {
    if let Some(folder) = std::env::var_os(CHILD) {
        return record_until_killed(&PathBuf::from(folder)).await;
    }
    let n_kills: u32 = std::env::var("VIDEOFIELDS_KILLS").map_or(10, |n| n.parse().unwrap());
    let mut numbers = Numbers(2026);
    let mut worst = Cost::default();
    let mut n_lives = 0;
    let mut place = tempfile::tempdir().unwrap();
    for kill in 0..n_kills {
        if kill % 10 == 0 {
            // A database for ten lives: neither always new nor ever larger.
            place = tempfile::tempdir().unwrap();
            frames(place.path());
        }
        let pushed = live_and_die(place.path(), Duration::from_millis(numbers.below(1500)));
        n_lives += u32::from(pushed[0].n_pushed > 0);
        let cost = come_back(place.path(), pushed).await;
        worst.opened = worst.opened.max(cost.opened);
        worst.n_lost = worst.n_lost.max(cost.n_lost);
    }
    assert!(n_lives * 2 > n_kills, "{n_lives} of {n_kills} recorded anything");
    assert!(worst.opened < Duration::from_secs(2), "{worst:?}");
    assert!(worst.n_lost <= GROUP as u64, "{worst:?}");
    say(&format!("{n_kills} kills, {n_lives} while recording: {worst:?}"));
}

/// Starts a process that records, and kills it `after` its first frame; what it said of each camera.
fn live_and_die(folder: &Path, after: Duration) -> [Said; CAMERAS.len()] {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([
            "archive::a_daemon_that_is_killed_at_any_moment_loses_a_fragment_at_most",
            "--exact",
            "--nocapture",
        ])
        .env(CHILD, folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut said = [Said::default(); CAMERAS.len()];
    for line in lines.by_ref().map_while(Result::ok) {
        if hear(&line, &mut said) {
            break;
        }
    }
    SystemClock::new().sleep(after);
    child.kill().unwrap();
    child.wait().unwrap();
    for line in lines.map_while(Result::ok) {
        hear(&line, &mut said);
    }
    said
}

/// Notes what a line of a recording process says; false where it says nothing. The last line may be cut.
fn hear(line: &str, said: &mut [Said; CAMERAS.len()]) -> bool {
    let mut words = line.split(' ').rev().map(|word| word.parse::<u64>().ok());
    match (line.rfind("pushed "), line.rfind("written "), words.next().flatten(), words.next().flatten()) {
        (Some(_), _, Some(idx), _) => said[idx as usize].n_pushed += 1,
        (_, Some(_), Some(n), Some(idx)) => said[idx as usize].n_written = n,
        _ => return false,
    }
    true
}

/// Opens what a killed process left, and holds it to what was promised.
async fn come_back(folder: &Path, said: [Said; CAMERAS.len()]) -> Cost {
    let clock = SystemClock::new();
    let (store, archive) = open(folder).await;
    let opened = clock.monotonic();
    wait_for("the survey", || archive.status().reconciled.is_done.then_some(()));
    assert_eq!(archive.status().reconciled.n_missing, 0);
    let mut all = Vec::new();
    for id in CAMERAS {
        let rows = rows(&store, &camera(id)).await;
        for pair in rows.windows(2) {
            assert!(pair[0].last_at < pair[1].first_at, "{pair:#?}");
        }
        all.push(rows);
    }
    let life = |row: &SegmentRecord| row.last_at.as_nanos() / LIFE_NANOS;
    let newest = all.iter().flatten().map(life).max().unwrap_or(0);
    let mut n_lost = 0;
    for (rows, said) in all.iter().zip(said) {
        // Those of earlier lives were looked at then.
        let latest = || rows.iter().filter(|row| life(row) == newest);
        let n_kept: u64 = latest().map(|row| row.n_frames).sum();
        n_lost = n_lost.max(said.n_pushed.saturating_sub(n_kept));
        // Of what was written not one frame is lost; what still waited may be.
        assert!(n_kept >= said.n_written, "{n_kept} of {said:?}");
        for row in latest() {
            let reading = archive.open_at(&row.camera, row.first_at).await.unwrap().unwrap();
            assert_eq!(n_decoded(Input::stream(reading)), row.n_frames, "{row:#?}");
        }
    }
    archive.stop();
    let worker = (settings(folder), store.clone());
    let checked = tokio::task::spawn_blocking(move || check(&worker.0, &worker.1)).await.unwrap().unwrap();
    assert_eq!(checked.faults, Vec::<String>::new());
    store.close().await.unwrap();
    Cost { opened, n_lost }
}

/// What is written while it is looked at is never shown by an older picture.
#[tokio::test(flavor = "multi_thread")]
async fn who_looks_back_at_what_is_being_written_sees_each_frame_as_soon_as_it_was_handed_over() {
    let folder = tempfile::tempdir().unwrap();
    let frames = frames(folder.path());
    let (store, archive) = open(folder.path()).await;
    let archive = Arc::new(archive);
    let (gate, start) = (camera("gate"), now());
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let replay = Replay::new(Arc::clone(&archive), Runtime::current(), clock, 256 << 20);
    let mut recorder = archive.recorder(&gate);
    let handed: Vec<_> = (0..3)
        .flat_map(|turn| frames.iter().map(move |frame| (turn, frame)))
        .map(|(turn, frame)| (frame, instant(start, turn, frame, &frames[0])))
        .collect();
    let looked = tokio::task::block_in_place(|| {
        let mut looked = 0;
        for (idx, (frame, at)) in handed.iter().enumerate() {
            recorder.push(frame, *at);
            // Frames come out of their order by three at most: those before are whole.
            let Some(place) = idx.checked_sub(6) else { continue };
            let mut times: Vec<_> = handed[..place + 3].iter().map(|(_, at)| *at).collect();
            times.sort_unstable();
            let asked = times[times.len() - 3];
            let shown = replay.frame_at(&gate, asked).unwrap();
            assert_eq!(shown.timestamp.nanos_since(asked), 0, "frame {idx}");
            looked += 1;
        }
        looked
    });
    assert_eq!(looked, 3 * frames.len() - 6);
    drop((recorder, replay));
    archive.stop();
    store.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_camera_without_key_frames_is_told_of() {
    let folder = tempfile::tempdir().unwrap();
    let frames = frames(folder.path());
    let (store, archive) = open(folder.path()).await;
    let mut recorder = archive.recorder(&camera(CAMERAS[0]));
    for frame in frames.iter().filter(|frame| !frame.is_key) {
        recorder.push(frame, instant(now(), 0, frame, &frames[0]));
    }
    // A look a second: half a minute is nothing yet.
    let looks: Vec<Option<String>> = (0..31).map(|_| recorder.look()).collect();
    assert!(looks[..30].iter().all(Option::is_none), "{looks:?}");
    assert!(looks[30].as_ref().is_some_and(|concern| concern.contains("no key frame")), "{looks:?}");
    let start = now();
    for frame in &frames {
        recorder.push(frame, instant(start, 0, frame, &frames[0]));
    }
    wait_for("the recording", || recorder.look().is_none().then_some(()));
    archive.stop();
    drop((recorder, archive));
    store.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_pauses_recording_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let frames = frames(folder.path());
    let Some(disk) = SmallDisk::mount(&folder.path().join("archive"), 1) else {
        say_skipped("this process may not mount a small disk");
        return;
    };
    let (store, archive) = open(folder.path()).await;
    let north = camera(CAMERAS[0]);
    let mut recorder = archive.recorder(&north);
    let (clock, start, mut turn) = (SystemClock::new(), now(), 0);
    let mut push = |recorder: &mut videofields_recording::archive::Recorder| {
        for frame in &frames {
            recorder.push(frame, instant(start, turn, frame, &frames[0]));
        }
        turn += 1;
        assert!(clock.monotonic() < Duration::from_secs(60), "{:#?}", archive.status());
        clock.sleep(Duration::from_millis(10));
    };
    let state = || archive.status().cameras[0].state.clone();
    let reason = loop {
        push(&mut recorder);
        if let RecordingState::Paused { reason } = state() {
            break reason;
        }
    };
    assert!(reason.contains("No space left"), "{reason}");
    assert_eq!(recorder.look(), Some(format!("recording is paused: {reason}")));
    // What was whole is there, and can be decoded.
    let kept = rows(&store, &north).await;
    assert!(kept.len() > 1, "{kept:#?}");
    for row in &kept {
        let reading = archive.open_at(&north, row.first_at).await.unwrap().unwrap();
        assert_eq!(n_decoded(Input::stream(reading)), row.n_frames, "{row:#?}");
    }
    // Room is made by whoever owns the disk, and recording goes on by itself.
    std::fs::remove_file(folder.path().join("archive").join(&kept[0].path)).unwrap();
    let n_before = archive.status().cameras[0].n_frames;
    while archive.status().cameras[0].n_frames <= n_before {
        push(&mut recorder);
        // So that what waits does not fill the disk again.
        clock.sleep(Duration::from_millis(10));
    }
    assert_eq!(recorder.look(), None);
    let clock = SystemClock::new();
    archive.stop();
    assert!(clock.monotonic() < Duration::from_secs(1), "{:?}", clock.monotonic());
    drop((recorder, archive));
    store.close().await.unwrap();
    drop(disk);
}

/// The command with its configuration: status, standard output, standard error.
fn run(command: &str, folder: &Path) -> (Option<i32>, String, String) {
    let mut process = Command::new(env!("CARGO_BIN_EXE_videofields"));
    let output = process.args([command, "site.toml"]).current_dir(folder).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[tokio::test(flavor = "multi_thread")]
async fn check_store_says_whether_the_audit_log_is_as_it_was_written() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    std::fs::write(folder.join("site.toml"), "[storage]\ndatabase = \"a.sqlite\"\n").unwrap();
    let store = Store::open(&folder.join("a.sqlite")).await.unwrap();
    for user in [None, Some("ann"), Some("bob")] {
        let entry = AuditEntry {
            at: Timestamp::from_nanos(7),
            user: user.map(str::to_owned),
            action: "PUT /api/v1/users/{id}".to_owned(),
            target: "/api/v1/users/eve".to_owned(),
            status: 201,
        };
        store.append_audit(&entry).await.unwrap();
    }
    let head = store.check_audit().await.unwrap().head.unwrap();
    store.close().await.unwrap();
    let (status, stdout, stderr) = run("check-store", folder);
    assert_eq!((status, stderr.as_str()), (Some(0), ""), "{stdout}");
    let said = format!("audit log: 3 entries as they were written, the last one's digest is {head}");
    assert!(stdout.contains(&said), "{stdout}");
    let path = format!("sqlite://{}", folder.join("a.sqlite").display());
    let mut connection = SqliteConnection::connect(&path).await.unwrap();
    let change = "drop trigger audit_is_not_changed; update audit set user = 'eve' where number = 2";
    sqlx::raw_sql(change).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    let (status, _, stderr) = run("check-store", folder);
    let is_told = stderr.contains("audit log: entry 2 or one before it is not as it was written");
    assert!(status == Some(1) && is_told, "{stderr}");
}

#[tokio::test(flavor = "multi_thread")]
async fn check_store_tells_every_fault_and_repair_mends_what_can_be() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    std::fs::write(
        folder.join("site.toml"),
        "[storage]\ndatabase = \"a.sqlite\"\n[archive]\nfolder = \"archive\"\nmin_free_mib = 0\n",
    )
    .unwrap();
    let (status, _, stderr) = run("check-store", folder);
    assert!(status == Some(1) && stderr.contains("there is no database: "), "{stderr}");
    assert!(!folder.join("a.sqlite").try_exists().unwrap(), "to look is not to make");

    let frames = frames(folder);
    let (store, archive) = open(folder).await;
    let mut recorder = archive.recorder(&camera("north"));
    let start = now();
    for turn in [0, 10, 20, 30] {
        for frame in &frames {
            recorder.push(frame, instant(start, turn, frame, &frames[0]));
        }
    }
    wait_for("the frames", || (archive.status().cameras[0].n_frames == 160).then_some(()));
    drop(recorder);
    archive.stop();
    let kept = rows(&store, &camera("north")).await;
    assert_eq!(kept.len(), 4);
    store.close().await.unwrap();
    drop(archive);
    let (status, stdout, stderr) = run("check-store", folder);
    assert_eq!((status, stderr.as_str()), (Some(0), ""), "{stdout}");
    assert!(stdout.contains("a.sqlite: good, 4 segments, 160 frames, "), "{stdout}");

    let file = |n: usize| folder.join("archive").join(&kept[n].path);
    std::fs::remove_file(file(0)).unwrap();
    let cut = std::fs::File::options().write(true).open(file(1)).unwrap();
    cut.set_len(kept[1].n_bytes - 10).unwrap();
    let mut damaged = std::fs::read(file(2)).unwrap();
    let middle = damaged.len() / 2;
    // A block's head, wherever it lies: all that comes after it is out of reach.
    let block = middle + damaged[middle..].windows(1).position(|byte| byte == [0xa3]).unwrap();
    damaged[block..].fill(0);
    std::fs::write(file(2), &damaged).unwrap();
    let orphan = folder.join("archive/north/2100-01-01/000000.000000000Z.mkv");
    std::fs::create_dir(orphan.parent().unwrap()).unwrap();
    std::fs::copy(file(3), &orphan).unwrap();
    std::fs::write(folder.join("archive/north/note.txt"), b"mine").unwrap();
    let (status, stdout, stderr) = run("check-store", folder);
    assert_eq!(status, Some(1), "{stdout}{stderr}");
    for (path, fault) in [
        (kept[0].path.as_str(), "there is no such file"),
        (&kept[1].path, "its row says"),
        (&kept[2].path, "it cannot be read beyond byte"),
        ("north/2100-01-01/000000.000000000Z.mkv", "no row knows this file"),
    ] {
        let is_told = stderr.lines().any(|line| line.contains(path) && line.contains(fault));
        assert!(is_told, "{path}: {fault} is not in {stderr}");
    }
    assert!(!stderr.contains(&kept[3].path) && !stderr.contains("note.txt"), "{stderr}");

    let (status, stdout, stderr) = run("repair", folder);
    assert_eq!(status, Some(1), "a damaged file stays damaged: {stdout}{stderr}");
    for line in ["1 files adopted", "1 segments marked as missing", "1 segments that lost bytes"] {
        assert!(stdout.contains(line), "{line} is not in {stdout}");
    }
    assert!(stderr.contains(&kept[2].path) && stderr.contains("1 faults"), "{stderr}");
    assert!(orphan.try_exists().unwrap() && folder.join("archive/north/note.txt").try_exists().unwrap());

    // While somebody records, nobody repairs.
    let (store, archive) = open(folder).await;
    let (status, _, stderr) = run("repair", folder);
    assert!(status == Some(1) && stderr.contains("another process records into it"), "{stderr}");
    archive.stop();
    store.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repair_is_what_a_start_does() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let pushed = {
        frames(folder);
        live_and_die(folder, Duration::from_millis(300))
    };
    assert!(pushed[0].n_pushed > 0);
    let store = Store::open(&folder.join("a.sqlite")).await.unwrap();
    let worker = (settings(folder), store.clone());
    let done =
        tokio::task::spawn_blocking(move || repair(&worker.0, &worker.1, Arc::new(SystemClock::new())));
    let done = done.await.unwrap().unwrap();
    assert!(done.n_closed + done.n_adopted >= 1 && done.is_done, "{done:?}");
    let mut lengths = BTreeMap::new();
    for id in CAMERAS {
        for row in rows(&store, &camera(id)).await {
            let len = std::fs::metadata(settings(folder).folder.join(&row.path)).unwrap().len();
            lengths.insert(row.path.clone(), (row.n_bytes, len));
        }
    }
    assert!(!lengths.is_empty() && lengths.values().all(|(said, len)| said <= len), "{lengths:?}");
    store.close().await.unwrap();
}
