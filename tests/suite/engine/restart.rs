//! A restart goes on where the run before it stopped.

use super::{Bench, FRAME_NANOS, SIZE, at, camera, pictures};
use tempfile::TempDir;
use videofields_recording::ingest::{self, CHECKPOINT_VERSION, MediaRoots, Pipeline};
use videofields_recording::store::{BackgroundRecord, Store};
use videofields_service::engine::At;
use videofields_testing::wait_for;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, End, SegmentSettings, Settings, SourceSettings};
use videofields_vision::frame::{CameraId, Frame, Mask};
use videofields_vision::segment::MOVING;

/// Share of pixels in which two masks differ.
fn difference(a: &Mask, b: &Mask) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let n_different = a.data.iter().zip(&b.data).filter(|(a, b)| a != b).count();
    n_different as f64 / a.data.len() as f64
}

fn segment() -> SegmentSettings {
    camera("north", "", End::Stop).segment
}

/// The frames of a folder of pictures as a camera that has no lateness delivers them.
fn frames(folder: &TempDir, name: &str) -> Vec<Frame> {
    let settings = SourceSettings {
        rate_hz: super::RATE_HZ,
        ..SourceSettings::of_path(folder.path().join(name).join("in%04d.png"))
    };
    let roots = MediaRoots::new(&[folder.path().to_owned()]).unwrap();
    let mut source = ingest::open(&settings, &roots).unwrap();
    std::iter::from_fn(|| source.next_frame().unwrap())
        .map(|next| Frame {
            camera: CameraId::new("north").unwrap(),
            timestamp: Timestamp::from_nanos(next.number as i64 * FRAME_NANOS),
            number: next.number,
            image: next.image,
        })
        .collect()
}

#[test]
fn the_first_mask_after_a_restart_is_that_of_an_unbroken_run() {
    const BEFORE: u32 = 60;
    let folder = TempDir::new().unwrap();
    let start = |name: &str, first: u32| {
        let mut settings = Settings::default();
        let mut north = camera("north", folder.path().join(name).join("in%04d.png"), End::Stop);
        north.source.start = Some(Timestamp::from_nanos(i64::from(first) * FRAME_NANOS));
        settings.camera = vec![north];
        Bench::start(folder.path(), settings, &[])
    };
    pictures(folder.path(), "before", 0..BEFORE);
    pictures(folder.path(), "after", BEFORE..BEFORE + 2);
    pictures(folder.path(), "all", 0..BEFORE + 1);

    let first_run = start("before", 0);
    first_run.wait_for_state("north", "ended");
    first_run.stop();
    let second_run = start("after", BEFORE);
    let restarted = wait_for("a mask", || second_run.handle.observation("north", At::Live).ok());
    let restarted = if restarted.frame.number == 0 {
        restarted
    } else {
        second_run.handle.observation("north", at(i64::from(BEFORE) * FRAME_NANOS)).unwrap()
    };
    second_run.stop();

    let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &segment());
    let unbroken = frames(&folder, "all").into_iter().map(|frame| pipeline.process(frame)).last().unwrap();
    assert_eq!(restarted.frame.timestamp, unbroken.frame.timestamp);
    let share = difference(&restarted.labels, &unbroken.labels);
    assert!(share <= 0.001, "{:.3} % of the pixels differ", share * 100.0);
    let n_moving = restarted.labels.data.iter().filter(|label| **label == MOVING).count();
    let n_pixels = (SIZE.0 * SIZE.1) as usize;
    assert!((200..n_pixels / 4).contains(&n_moving), "the box alone moves: {n_moving} of {n_pixels}");
}

#[test]
fn what_the_store_gives_back_changes_no_bit_of_a_mask() {
    let folder = TempDir::new().unwrap();
    pictures(folder.path(), "all", 0..50);
    let frames = frames(&folder, "all");
    let new = || Pipeline::new(&BackgroundSettings::default(), &segment());
    let mut unbroken = new();
    for frame in &frames[..40] {
        unbroken.process(frame.clone());
    }
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let camera = CameraId::new("north").unwrap();
    let (format, seen) = unbroken.current().unwrap();
    let record = BackgroundRecord {
        camera: camera.clone(),
        saved_at: seen.unwrap(),
        width: format.width,
        height: format.height,
        matrix: format.matrix,
        version: CHECKPOINT_VERSION,
        bytes: unbroken.checkpoint().unwrap(),
    };
    let path = folder.path().join("kept.sqlite");
    runtime.block_on(async {
        let store = Store::open(&path).await.unwrap();
        store.put_background(&record).await.unwrap();
        store.close().await.unwrap();
    });
    let kept = runtime.block_on(async {
        let store = Store::open(&path).await.unwrap();
        let kept = store.background(&camera, SIZE.0, SIZE.1).await.unwrap().unwrap();
        store.close().await.unwrap();
        kept
    });
    let mut restarted = new();
    restarted.restore(&kept.bytes).unwrap();
    for frame in &frames[40..] {
        let [a, b] = [&mut unbroken, &mut restarted].map(|pipeline| pipeline.process(frame.clone()));
        assert_eq!(a.labels, b.labels, "frame {}", frame.number);
    }
}

#[test]
fn a_background_of_the_frames_size_is_restored_though_another_is_newer() {
    let folder = TempDir::new().unwrap();
    pictures(folder.path(), "before", 0..60);
    pictures(folder.path(), "after", 60..62);
    let run = |name: &str, first: i64| {
        let mut settings = Settings::default();
        let mut north = camera("north", folder.path().join(name).join("in%04d.png"), End::Stop);
        north.source.start = Some(Timestamp::from_nanos(first * FRAME_NANOS));
        settings.camera = vec![north];
        let bench = Bench::start(folder.path(), settings, &[]);
        bench.wait_for_state("north", "ended");
        bench.stop()
    };
    // Another size, whose scene time lies a day later.
    let larger = folder.path().join("larger");
    std::fs::create_dir(&larger).unwrap();
    for number in 0..3 {
        image::GrayImage::from_pixel(80, 60, image::Luma([90]))
            .save(larger.join(format!("in{number:04}.png")))
            .unwrap();
    }
    run("larger", 86_400 * 50);
    run("before", 0);
    let handle = run("after", 60);
    let first = handle.observation("north", at(60 * FRAME_NANOS)).unwrap();
    let n_moving = first.labels.data.iter().filter(|label| **label == MOVING).count();
    // A model that begins anew takes its first picture for background and finds nothing; a machine under load leaves
    // frames out, and the box with them.
    assert!(n_moving >= 12 * 24 / 2, "the first mask shows the box: {n_moving}");
}
