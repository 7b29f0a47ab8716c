//! The history of backgrounds: what is kept of it, what is found in it, and that the past is segmented with it.

use super::{at, camera, folder, open};
use std::sync::Arc;
use videofields_recording::ingest::{CHECKPOINT_VERSION, Pipeline};
use videofields_recording::store::{BackgroundHistoryBounds, BackgroundRecord, Store};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, YuvImage, YuvLayout};
use videofields_vision::segment::MOVING;

const WIDE: BackgroundHistoryBounds = BackgroundHistoryBounds { count: 1000, bytes: 1 << 30 };

fn entry(id: &str, saved_at: i64, n_bytes: usize) -> BackgroundRecord {
    BackgroundRecord {
        camera: camera(id),
        saved_at: at(saved_at),
        width: 640,
        height: 480,
        matrix: ColorMatrix::Bt709,
        version: 1,
        bytes: vec![saved_at as u8; n_bytes],
    }
}

async fn put(store: &Store, id: &str, saved_at: i64, n_bytes: usize, bounds: BackgroundHistoryBounds) {
    store.put_background_history(&entry(id, saved_at, n_bytes), bounds).await.expect("written");
}

/// Times and bytes of a camera's entries.
async fn kept(store: &Store, id: &str) -> Vec<(i64, u64)> {
    let entries = store.background_history(&camera(id)).await.expect("read");
    entries.into_iter().map(|(saved_at, _, _, bytes)| (saved_at.as_nanos(), bytes)).collect()
}

async fn times(store: &Store, id: &str) -> Vec<i64> {
    kept(store, id).await.into_iter().map(|(saved_at, _)| saved_at).collect()
}

#[tokio::test]
async fn the_background_of_a_time_is_the_one_before_it_or_else_the_first_after_it() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    let found = async |store: &Store, height, time| {
        let found = store.background_at(&camera("north"), 640, height, at(time)).await.expect("read");
        found.map(|record| record.saved_at.as_nanos())
    };
    assert_eq!(found(&store, 480, 0).await, None);
    assert_eq!(store.background_history(&camera("north")).await.expect("read"), []);
    for saved_at in [100, 200, 300] {
        put(&store, "north", saved_at, 5, WIDE).await;
    }
    put(&store, "south", 150, 5, WIDE).await;
    let tall = BackgroundRecord { height: 640, ..entry("north", 250, 7) };
    store.put_background_history(&tall, WIDE).await.expect("written");
    store.close().await.expect("closed");

    let store = open(&path).await;
    for (time, expected) in [
        (i64::MIN, 100),
        (99, 100),
        (100, 100),
        (199, 100),
        (200, 200),
        (299, 200),
        (300, 300),
        (i64::MAX, 300),
    ] {
        assert_eq!(found(&store, 480, time).await, Some(expected), "at {time}");
    }
    assert_eq!(found(&store, 640, 0).await, Some(250), "of another size there is this one alone");
    assert_eq!(found(&store, 479, 0).await, None);
    let read = store.background_at(&camera("north"), 640, 480, at(250)).await.expect("read");
    assert_eq!(read, Some(entry("north", 200, 5)));
    let listed = store.background_history(&camera("north")).await.expect("read");
    let expected = [(at(100), 640, 480, 5), (at(200), 640, 480, 5), (at(250), 640, 640, 7)];
    assert_eq!(listed[..3], expected);
    assert_eq!(store.last_background_history(&camera("north")).await.expect("read"), Some(at(250)));
    assert_eq!(store.last_background_history(&camera("east")).await.expect("read"), None);
    assert_eq!(
        store.latest_background(&camera("north")).await.expect("read"),
        None,
        "checkpoints are another table"
    );
}

#[tokio::test]
async fn a_camera_keeps_so_many_entries_and_others_are_not_touched() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    let bounds = BackgroundHistoryBounds { count: 3, ..WIDE };
    for saved_at in 1..=5 {
        put(&store, "north", saved_at, 1, bounds).await;
        put(&store, "south", 10 * saved_at, 1, bounds).await;
        assert!(times(&store, "north").await.len() <= 3);
    }
    assert_eq!(times(&store, "north").await, [3, 4, 5]);
    assert_eq!(times(&store, "south").await, [30, 40, 50]);
    // A lowered bound reaches the camera that writes nothing, too; 0 counts as 1.
    put(&store, "north", 6, 1, BackgroundHistoryBounds { count: 0, ..WIDE }).await;
    assert_eq!((times(&store, "north").await, times(&store, "south").await), (vec![6], vec![50]));
}

#[tokio::test]
async fn all_cameras_together_keep_so_many_bytes_to_the_byte() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    let bounds = BackgroundHistoryBounds { bytes: 100, ..WIDE };
    put(&store, "north", 1, 40, bounds).await;
    put(&store, "south", 2, 30, bounds).await;
    put(&store, "north", 3, 30, bounds).await;
    assert_eq!(kept(&store, "north").await, [(1, 40), (3, 30)], "100 bytes are 100");
    put(&store, "north", 4, 1, bounds).await;
    assert_eq!(kept(&store, "north").await, [(3, 30), (4, 1)], "of 101 the oldest goes, whole");
    // 61 are kept; south's only entry is older than north's, and stays as its newest.
    put(&store, "north", 5, 70, bounds).await;
    assert_eq!(kept(&store, "north").await, [(5, 70)]);
    assert_eq!(kept(&store, "south").await, [(2, 30)]);
    put(&store, "south", 6, 30, bounds).await;
    assert_eq!(kept(&store, "south").await, [(6, 30)]);
    // An entry of no bytes takes no room.
    put(&store, "east", 7, 0, bounds).await;
    assert_eq!((times(&store, "east").await, times(&store, "north").await), (vec![7], vec![5]));
}

#[tokio::test]
async fn an_entry_without_room_beside_the_others_newest_is_refused() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    put(&store, "north", 1, 20, WIDE).await;
    put(&store, "north", 2, 60, WIDE).await;
    put(&store, "south", 3, 25, WIDE).await;
    let bounds = BackgroundHistoryBounds { bytes: 100, ..WIDE };
    let error = store.put_background_history(&entry("south", 4, 41), bounds).await.expect_err("no room");
    assert_eq!(error.kind(), ErrorKind::TooLarge);
    assert!(error.to_string().contains("has 41 bytes; at most 40 are kept"), "{error}");
    assert_eq!(times(&store, "north").await, [2], "the bound is held all the same");
    assert_eq!(times(&store, "south").await, [3]);
    put(&store, "south", 4, 40, bounds).await;
    assert_eq!((kept(&store, "north").await, kept(&store, "south").await), (vec![(2, 60)], vec![(4, 40)]));
    // Its own newest makes room for the next.
    put(&store, "north", 5, 59, bounds).await;
    assert_eq!(times(&store, "north").await, [5]);
    // A bound below what the newest take leaves them alone and takes nothing more.
    let none = BackgroundHistoryBounds { bytes: 0, ..WIDE };
    store.put_background_history(&entry("north", 6, 1), none).await.expect_err("no room");
    assert_eq!((times(&store, "north").await, times(&store, "south").await), (vec![5], vec![4]));
}

#[tokio::test]
async fn a_clock_that_steps_back_loses_nothing_that_was_just_written() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    let bounds = BackgroundHistoryBounds { count: 3, ..WIDE };
    // The clock was years ahead, and was set right.
    for saved_at in [1000, 2000, 3000, 10, 20] {
        put(&store, "north", saved_at, 1, bounds).await;
    }
    assert_eq!(times(&store, "north").await, [10, 20, 3000], "what was written longest ago went");
    assert_eq!(store.last_background_history(&camera("north")).await.expect("read"), Some(at(20)));
    put(&store, "north", 30, 1, bounds).await;
    assert_eq!(times(&store, "north").await, [10, 20, 30]);

    // The same instant again replaces, and counts as written last.
    put(&store, "north", 10, 9, bounds).await;
    assert_eq!(kept(&store, "north").await, [(10, 9), (20, 1), (30, 1)]);
    let tall = BackgroundRecord { height: 640, ..entry("north", 20, 2) };
    store.put_background_history(&tall, bounds).await.expect("written");
    assert_eq!(kept(&store, "north").await, [(10, 9), (20, 2), (30, 1)], "be it of another size");
    put(&store, "north", 40, 1, bounds).await;
    assert_eq!(times(&store, "north").await, [10, 20, 40], "30 was written before both");

    // Over all cameras, too: one in 1970 is not older than one of today.
    let bounds = BackgroundHistoryBounds { bytes: 15, ..WIDE };
    put(&store, "south", -5, 1, bounds).await;
    put(&store, "south", i64::MIN, 2, bounds).await;
    put(&store, "south", i64::MAX, 3, bounds).await;
    assert_eq!(times(&store, "north").await, [20, 40], "10 was written before 20 and 40");
    assert_eq!(times(&store, "south").await, [i64::MIN, -5, i64::MAX]);
}

#[tokio::test]
async fn a_history_that_cannot_be_written_is_as_before() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    put(&store, "north", 1, 4, WIDE).await;
    put(&store, "north", 2, 4, WIDE).await;
    // No picture has no columns; bounds that would let both go must not be held half.
    let broken = BackgroundRecord { width: 0, ..entry("north", 1, 4) };
    let bounds = BackgroundHistoryBounds { count: 1, ..WIDE };
    store.put_background_history(&broken, bounds).await.expect_err("refused by the table");
    assert_eq!(kept(&store, "north").await, [(1, 4), (2, 4)]);
}

/// A noisy floor, with bright boxes whose left edges are given, at the scene time `secs`.
fn yard(secs: i64, lefts: &[u32]) -> Frame {
    let layout = YuvLayout::packed(96, 64);
    let mut data = vec![128; YuvLayout::packed_len(96, 64)];
    for (i, sample) in data[..96 * 64].iter_mut().enumerate() {
        let (x, y) = (i as u32 % 96, i as u32 / 96);
        let is_box = (20..50).contains(&y) && lefts.iter().any(|left| (*left..left + 16).contains(&x));
        let noise = (i as u64 ^ secs as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62;
        *sample = if is_box { 210 } else { 90 } + noise as u8;
    }
    let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).expect("a picture");
    Frame {
        camera: CameraId::new("north").expect("an id"),
        timestamp: Timestamp::from_nanos(secs * 1_000_000_000),
        number: secs as u64,
        image: Arc::new(image),
    }
}

fn new_pipeline() -> Pipeline {
    let segment = SegmentSettings { min_area_px: 40, ..SegmentSettings::default() };
    Pipeline::new(&BackgroundSettings::default(), &segment)
}

/// Left and right edge of everything that moves in a frame, segmented with the background of `time`, seconds.
async fn moving_with_background_of(store: &Store, time: i64, frame: Frame) -> Vec<(u32, u32)> {
    let mut pipeline = new_pipeline();
    let (width, height) = pipeline.model_size_px(frame.image.width(), frame.image.height());
    let time = Timestamp::from_nanos(time * 1_000_000_000);
    let record = store.background_at(&frame.camera, width, height, time).await.expect("read").expect("there");
    pipeline.restore(&record.bytes).expect("a checkpoint");
    let observation = pipeline.process(frame);
    let n_moving = observation.labels.data.iter().filter(|label| **label == MOVING).count();
    let n_in_blobs: u32 = observation.blobs.iter().map(|blob| blob.area_px).sum();
    assert_eq!(n_moving, n_in_blobs as usize);
    let mut edges: Vec<_> =
        observation.blobs.iter().map(|blob| (blob.rect.x, blob.rect.x + blob.rect.width)).collect();
    edges.sort_unstable();
    edges
}

#[tokio::test]
async fn a_pipeline_segments_with_the_background_of_the_time_that_it_was_restored_from() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    // In the morning a van stands on the left; at noon it has been on the right for long.
    const VAN: [u32; 2] = [8, 64];
    for (start, van) in [(1000, VAN[0]), (5000, VAN[1])] {
        let mut pipeline = new_pipeline();
        for secs in start..start + 200 {
            pipeline.process(yard(secs, &[van]));
        }
        let (format, seen) = pipeline.current().expect("learned");
        let record = BackgroundRecord {
            camera: camera("north"),
            saved_at: seen.expect("a time"),
            width: format.width,
            height: format.height,
            matrix: format.matrix,
            version: CHECKPOINT_VERSION,
            bytes: pipeline.checkpoint().expect("learned"),
        };
        store.put_background_history(&record, WIDE).await.expect("written");
    }
    // The same empty place but for a person in the middle, and the van as it stood in the morning.
    let person = 36;
    let near = |found: &[(u32, u32)], lefts: &[u32]| {
        let is_near = |(found, left): (&(u32, u32), &u32)| {
            found.0.abs_diff(*left) <= 2 && found.1.abs_diff(left + 16) <= 2
        };
        found.len() == lefts.len() && found.iter().zip(lefts).all(is_near)
    };
    for (time, expected) in [
        (0, &[person][..]),
        (1300, &[person]),
        (5000, &[person]),
        (5300, &[VAN[0], person, VAN[1]]),
        (9000, &[VAN[0], person, VAN[1]]),
    ] {
        let found = moving_with_background_of(&store, time, yard(1300, &[VAN[0], person])).await;
        assert!(near(&found, expected), "with the background of {time} s: {found:?}, not at {expected:?}");
    }
}
