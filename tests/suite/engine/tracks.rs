//! Who crossed which part of the ground is found again: from pictures through the database to the door.

use super::{Bench, SCENE, SIZE, camera, wait_for};
use glam::DVec2;
use sqlx::{Connection, SqliteConnection};
use std::path::{Path, PathBuf};
use videofields_picture::scene;
use videofields_recording::store::TrackRecord;
use videofields_service::engine::{EngineError, FoundTrack, FoundTracks, TrackQuery};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{End, SegmentSettings, Settings};
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::GroundPolygon;
use videofields_vision::mapping;
use videofields_vision::track::FootPath;

/// Frames a second: few enough that two cameras keep up on a busy machine, since what comes too late is left out.
const RATE_HZ: f64 = 25.0;

/// Columns and rows of what walks.
const WALKER: (u32, u32) = (12, 16);

/// The same of what is smaller than a blob elsewhere in such a picture: 13 pixels of it are found, and a blob has 16.
const SMALL_WALKER: (u32, u32) = (5, 5);

/// First frame of a walk from the left to the right, and the row of the feet: two walk far off, one walks near.
const WALKS: [(u32, u32); 3] = [(30, 18), (130, 44), (230, 18)];

/// Frames of a walk.
const WALK: u32 = 80;

/// Texture rows between which feet are far off, and near.
const FAR: [f64; 2] = [0.2, 0.6];
const NEAR: [f64; 2] = [0.7, 1.0];

fn at(secs: f64) -> Timestamp {
    Timestamp::from_nanos((secs * 1e9) as i64)
}

/// Column of the left edge of what walks, `frame` frames after it began.
fn left(frame: u32, walker: (u32, u32)) -> u32 {
    (SIZE.0 - walker.0) * frame / WALK
}

/// Makes a folder of pictures of a noisy floor over which a walker goes, as often as `walks` says; their pattern.
pub(super) fn pictures_of(folder: &Path, walks: &[(u32, u32)], walker: (u32, u32)) -> PathBuf {
    let folder = folder.join("walks");
    std::fs::create_dir_all(&folder).unwrap();
    let end = walks.last().map_or(0, |(first, _)| first + WALK + 20);
    for number in 0..end {
        let walking = walks.iter().find(|(first, _)| (*first..first + WALK).contains(&number));
        let picture = image::GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let is_walker = walking.is_some_and(|(first, foot)| {
                let left = left(number - first, walker);
                (left..left + walker.0).contains(&x) && (foot - walker.1..*foot).contains(&y)
            });
            let hash = (u64::from(x) | u64::from(y) << 16 | u64::from(number) << 32)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(23)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15);
            image::Luma([if is_walker { 220 } else { 96 + (hash >> 62) as u8 }])
        });
        picture.save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

/// What `north` shows between two columns and two rows of its texture, on the ground.
fn region([left, right]: [f64; 2], [top, bottom]: [f64; 2]) -> GroundPolygon {
    let scene = scene::parse("yard", SCENE, scene::no_imports).unwrap().scene;
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]].map(|texture| {
        let camera = &scene.cameras[0].camera;
        mapping::place(camera, &scene.surfaces, DVec2::from_array(texture)).unwrap().truncate()
    });
    GroundPolygon::new(corners.to_vec(), 0.0).unwrap()
}

fn asked(region: Option<GroundPolygon>) -> TrackQuery {
    TrackQuery { span: (at(-10.0), at(60.0)), cameras: None, region, before: None, limit: 100 }
}

fn search(bench: &Bench, query: &TrackQuery) -> FoundTracks {
    bench.handle.search_tracks("yard", query).unwrap()
}

fn feet(track: &FoundTrack) -> impl Iterator<Item = f64> + '_ {
    track.path.iter().map(|point| point.texture[1])
}

/// Whether a track is of a walk.
fn is_of(track: &FoundTrack, (first, foot): (u32, u32)) -> bool {
    let (began, ended) = (f64::from(first) / RATE_HZ, f64::from(first + WALK) / RATE_HZ);
    let row = f64::from(foot) / f64::from(SIZE.1);
    track.began_at >= at(began)
        && track.ended_at <= at(ended + 0.1)
        && feet(track).all(|v| (v - row).abs() < 0.1)
}

#[test]
fn who_crossed_a_region_is_found_and_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = pictures_of(folder.path(), &WALKS, WALKER);
    let mut camera = vec![camera("north", &path, End::Stop), camera("south", &path, End::Stop)];
    camera.iter_mut().for_each(|camera| camera.source.rate_hz = RATE_HZ);
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[("yard", SCENE)]);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    // The last ones are written when the camera has ended.
    let all = wait_for("both cameras' tracks", || {
        let found = search(&bench, &asked(None));
        let n_of = |id: &str| found.tracks.iter().filter(|track| track.camera.as_str() == id).count();
        (n_of("north") >= 3 && n_of("south") >= 3).then_some(found)
    });
    assert_eq!(all.next, None);
    let order: Vec<_> =
        all.tracks.iter().map(|track| (track.began_at, &track.camera, track.number)).collect();
    assert!(order.is_sorted_by(|a, b| a > b), "newest first: {order:?}");
    for walk in WALKS {
        let of: Vec<_> = all.tracks.iter().filter(|track| is_of(track, walk)).collect();
        assert_eq!(of.len(), 2, "{walk:?} before each camera: {of:#?}");
        assert!(of.iter().all(|track| track.in_region.is_none() && track.path.len() >= 8), "{of:#?}");
        assert!(of.iter().flat_map(|track| &track.path).all(|point| point.point_m.is_some()));
        let height = f64::from(WALKER.1) / f64::from(SIZE.1);
        assert!(of.iter().all(|track| (track.height_share - height).abs() < 0.1), "{of:#?}");
    }

    rows_of_the_ground_tell_walks_apart(&bench);
    an_answer_goes_on_where_it_ended(&bench, &all);
    let refused = TrackQuery { cameras: Some(vec![CameraId::new("nort").unwrap()]), ..asked(None) };
    let error = bench.handle.search_tracks("yard", &refused).unwrap_err();
    assert!(matches!(&error, EngineError::Request(fault) if fault.place == "cameras"), "{error}");
    assert!(error.to_string().contains("did you mean `north`?"), "{error}");
    let error = bench.handle.search_tracks("none", &asked(None)).unwrap_err();
    assert!(matches!(error, EngineError::NoScene { .. }), "{error}");
    bench.stop();
    another_calibration_places_what_was_seen_before(folder.path(), &all);
}

/// Returns the yard as a scene of one of its cameras, in which objects are at least so large.
fn yard_of(camera: &str, min_size_m: f64) -> String {
    let mut document: serde_json::Value = serde_json::from_str(SCENE).unwrap();
    document["entities"] = serde_json::json!({"min_size_m": min_size_m});
    document["cameras"].as_array_mut().unwrap().retain(|of| of["id"] == camera);
    document.to_string()
}

#[test]
fn who_is_smaller_than_a_blob_has_a_track_where_the_scene_says_that_people_are_small_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = pictures_of(folder.path(), &[(30, 18)], SMALL_WALKER);
    let mut camera = vec![camera("north", &path, End::Stop), camera("south", &path, End::Stop)];
    for camera in &mut camera {
        camera.source.rate_hz = RATE_HZ;
        camera.segment = SegmentSettings::default();
    }
    let scenes = [("people", &*yard_of("north", 0.0)), ("trucks", &*yard_of("south", 3.0))];
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &scenes);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    let tracks_of = |scene: &str| bench.handle.search_tracks(scene, &asked(None)).unwrap().tracks;
    let found = wait_for("the track", || Some(tracks_of("people")).filter(|tracks| !tracks.is_empty()));
    assert!(found.len() == 1 && is_of(&found[0], (30, 18)), "{found:#?}");
    assert_eq!(tracks_of("trucks").len(), 0);
    bench.stop();
}

fn rows_of_the_ground_tell_walks_apart(bench: &Bench) {
    let of_north = |region: GroundPolygon| TrackQuery {
        cameras: Some(vec![CameraId::new("north").unwrap()]),
        ..asked(Some(region))
    };
    let north = |region: GroundPolygon| search(bench, &of_north(region)).tracks;
    let far = north(region([0.02, 0.98], FAR));
    assert_eq!(far.len(), 2, "{far:#?}");
    assert!(far.iter().all(|track| track.camera.as_str() == "north"));
    assert!(is_of(&far[0], WALKS[2]) && is_of(&far[1], WALKS[0]), "{far:#?}");
    let near = north(region([0.02, 0.98], NEAR));
    assert!(near.len() == 1 && is_of(&near[0], WALKS[1]), "{near:#?}");
    let beside =
        GroundPolygon::new([[-10.0, -10.0], [-9.0, -10.0], [-9.0, -9.0]].map(DVec2::from_array).into(), 0.0);
    assert!(north(beside.unwrap()).is_empty());
    // The right half alone: from the time at which the middle of what walks was in the middle of the picture.
    let right = north(region([0.5, 0.98], FAR));
    assert_eq!(right.len(), 2, "{right:#?}");
    for (track, (first, _)) in right.iter().zip([WALKS[2], WALKS[0]]) {
        let halfway = (f64::from(first) + f64::from(WALK) / 2.0) / RATE_HZ;
        let (entered, _) = track.in_region.unwrap();
        let late_secs = entered.secs_since(at(halfway));
        assert!(late_secs.abs() < 0.15, "{late_secs} s: {track:#?}");
    }
    // In the span, but over the right half only after it.
    let early = f64::from(WALKS[0].0 + WALK / 4) / RATE_HZ;
    let query = TrackQuery { span: (at(0.0), at(early)), ..of_north(region([0.6, 0.98], FAR)) };
    assert_eq!(search(bench, &query).tracks, []);
    let query = TrackQuery { span: (at(0.0), at(early)), ..asked(None) };
    assert!(search(bench, &query).tracks.iter().all(|track| is_of(track, WALKS[0])), "the others come later");
}

fn an_answer_goes_on_where_it_ended(bench: &Bench, all: &FoundTracks) {
    let mut query = TrackQuery { limit: 1, ..asked(None) };
    let mut paged = Vec::new();
    loop {
        let found = search(bench, &query);
        assert!(found.tracks.len() <= 1);
        paged.extend(found.tracks);
        query.before = found.next;
        if query.before.is_none() {
            break;
        }
    }
    assert_eq!(paged, all.tracks);
}

/// What was seen is kept over a restart, placed by the scene's calibration of now, and damage costs only what it hits.
fn another_calibration_places_what_was_seen_before(folder: &Path, all: &FoundTracks) {
    let moved = SCENE.replace("[0, 8, 6]", "[3, 8, 6]");
    let bench = Bench::start(folder, Settings::default(), &[("yard", &moved)]);
    let found = search(&bench, &asked(None));
    assert_eq!(found.tracks.len(), all.tracks.len());
    for (now, before) in
        found.tracks.iter().zip(&all.tracks).filter(|(now, _)| now.camera.as_str() == "north")
    {
        assert_eq!((now.began_at, now.path.len()), (before.began_at, before.path.len()));
        for (now, before) in now.path.iter().zip(&before.path) {
            // What is beside the ground now has no place.
            let Some(place) = now.point_m else { continue };
            assert!((place[0] - before.point_m.unwrap()[0] - 3.0).abs() < 1e-6);
        }
    }
    bench.runtime.block_on(async {
        let url = format!("sqlite://{}", folder.join("test.sqlite").display());
        let mut other = SqliteConnection::connect(&url).await.unwrap();
        let damage = "update track set path = x'01ff' where camera = 'north' and began_at = (select max(began_at) from track where camera = 'north')";
        sqlx::raw_sql(damage).execute(&mut other).await.unwrap();
    });
    let left = search(&bench, &asked(None));
    assert_eq!((left.tracks.len(), left.next), (all.tracks.len() - 1, None));
    bench.stop();
}

#[test]
fn a_search_among_many_is_cut_short_and_goes_on() {
    const N_TRACKS: u64 = 20_100;
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    let north = CameraId::new("north").unwrap();
    // All walk the same way, a second apart; every hundredth farther off.
    let record = |number: u64| {
        let row = if number.is_multiple_of(100) { 0.4 } else { 0.9 };
        let mut path = FootPath::new(at(number as f64), [0.1, row]).unwrap();
        for step in 1..=8 {
            path.add(at(number as f64 + f64::from(step)), [0.1 + 0.1 * f64::from(step), row]);
        }
        TrackRecord {
            began_at: path.began_at(),
            ended_at: path.ended_at(),
            number,
            feet: path.feet(),
            height: 9,
            path: path.encode(),
        }
    };
    let records: Vec<_> = (1..=N_TRACKS).map(record).collect();
    bench.runtime.block_on(bench.store.put_tracks(&north, &records)).unwrap();
    let whole = (at(0.0), at(1e6));
    let elsewhere =
        GroundPolygon::new([[9e7, 9e7], [9.1e7, 9e7], [9e7, 9.1e7]].map(DVec2::from_array).into(), 0.0);
    let mut query = TrackQuery { span: whole, ..asked(Some(elsewhere.unwrap())) };
    let found = search(&bench, &query);
    let next = found.next.expect("the bound is reached");
    assert_eq!((found.tracks.len(), next.number), (0, 101), "20,000 were looked at and none was there");
    query.before = Some(next);
    assert_eq!(search(&bench, &query), FoundTracks::default(), "and none of the rest");

    let far = TrackQuery { limit: 1000, span: whole, ..asked(Some(region([0.02, 0.98], FAR))) };
    let mut found = search(&bench, &far);
    let rest = search(&bench, &TrackQuery { before: found.next.take(), ..far });
    let numbers: Vec<_> = found.tracks.iter().chain(&rest.tracks).map(|track| track.number).collect();
    assert_eq!(numbers, (1..=201).rev().map(|hundred| hundred * 100).collect::<Vec<_>>());
    // Answers are bounded in points as well: of 9 each.
    let all = TrackQuery { limit: 20_000, span: whole, ..asked(None) };
    let found = search(&bench, &all);
    let n_points: usize = found.tracks.iter().map(|track| track.path.len()).sum();
    assert!((50_000..50_009).contains(&n_points) && found.next.is_some(), "{n_points}");
    bench.stop();
}
