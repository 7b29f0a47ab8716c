//! People have one id each, now and when it is over: from pictures through the database to the door.

use super::rights::grants;
use super::tracks::pictures_of;
use super::{Bench, SCENE, camera, wait_for};
use std::path::Path;
use std::sync::Arc;
use videofields_service::engine::{
    At, EntityQuery, FoundEntities, FoundEntity, Handle, Present, Privacy, TrackQuery,
};
use videofields_vision::access::{Right, Role};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{End, EntitySettings, Pace, Settings};
use videofields_vision::frame::Zone;

/// Frames a second.
const RATE_HZ: f64 = 25.0;

/// Pictures in which somebody walks at the same place before both cameras: first frame, and the row of the feet.
const WALKS: [(u32, u32); 2] = [(30, 44), (150, 18)];

fn everything() -> (Timestamp, Timestamp) {
    (Timestamp::from_nanos(-10_000_000_000), Timestamp::from_nanos(60_000_000_000))
}

fn start(folder: &Path, rate_hz: f64) -> Bench {
    // The same walks in two places: zones follow the footage.
    let path = |place: &str| {
        let folder = folder.join(place);
        match folder.join("walks").is_dir() {
            true => folder.join("walks/in%04d.png"),
            false => pictures_of(&folder, &WALKS, (12, 16)),
        }
    };
    let mut camera =
        vec![camera("north", path("north"), End::Stop), camera("south", path("south"), End::Stop)];
    for camera in &mut camera {
        camera.source.rate_hz = RATE_HZ;
        // People are placed as time passes.
        camera.source.pace = Pace::RealTime;
    }
    let entities = EntitySettings { rate_hz };
    Bench::start(folder, Settings { camera, entities, ..Settings::default() }, &[("yard", SCENE)])
}

fn paths(handle: &Handle) -> FoundEntities {
    let query = EntityQuery { span: everything(), after: None, limit: 1000 };
    handle.search_entities("yard", &query).unwrap()
}

/// Returns who was told to be present, as often as that changed, until both cameras have ended.
fn watched(bench: &Bench) -> Vec<Arc<Present>> {
    let mut seen: Vec<Arc<Present>> = Vec::new();
    let is_over = || ["north", "south"].iter().all(|id| bench.summary(id).state == "ended");
    while !is_over() {
        if let Ok(present) = bench.handle.present("yard")
            && seen.last().is_none_or(|last| last.instant < present.instant)
        {
            seen.push(present);
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    seen
}

#[test]
fn the_past_has_the_ids_that_the_present_had_and_so_has_another_run_of_the_daemon() {
    let folder = tempfile::tempdir().unwrap();
    let bench = start(folder.path(), 10.0);
    let seen = watched(&bench);
    let placed: Vec<&Arc<Present>> = seen.iter().filter(|present| !present.entities.is_empty()).collect();
    assert!(placed.len() > 10, "somebody walked for six seconds: {}", placed.len());
    // Whoever was seen once is nobody; all others are there again, where and as whom they were.
    let ids = |of: &Present| of.entities.iter().map(|entity| entity.id).collect::<Vec<_>>();
    let n_seen = |id: u64| placed.iter().filter(|present| ids(present).contains(&id)).count();
    let check = |handle: &Handle| {
        for present in &placed {
            let past = handle.present_at("yard", At::Time(present.instant)).unwrap();
            for entity in present.entities.iter().filter(|entity| n_seen(entity.id) > 1) {
                let again = past.entities.iter().find(|of| of.id == entity.id);
                let again = again.unwrap_or_else(|| panic!("{} at {}: {past:?}", entity.id, present.instant));
                let away_m = again.foot_in_world.distance(entity.foot_in_world);
                assert!(away_m < 0.6, "{} at {}: {away_m} m", entity.id, present.instant);
            }
        }
    };
    check(&bench.handle);
    let all = paths(&bench.handle);
    assert!(all.next.is_none() && all.entities.iter().all(|of| of.path.is_sorted_by_key(|stand| stand.at)));
    // Each track is of one of them.
    let tracks = wait_for("both cameras' tracks", || {
        let query = TrackQuery { span: everything(), cameras: None, region: None, before: None, limit: 100 };
        let tracks = bench.handle.search_tracks("yard", &query).unwrap().tracks;
        (tracks.len() >= 4).then_some(tracks)
    });
    let of_somebody = tracks.iter().filter(|track| track.entity.is_some_and(|id| n_seen(id) > 1)).count();
    assert!(of_somebody >= 4, "{tracks:#?}");
    bench.stop();
    let next = Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    check(&next.handle);
    assert_eq!(paths(&next.handle).entities, all.entities);
    next.stop();
}

#[test]
fn what_was_not_placed_at_the_time_follows_from_tracks_once_and_for_each_set_of_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let bench = start(folder.path(), 0.0);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    let all = wait_for("people by tracks", || {
        let found = paths(&bench.handle);
        (found.entities.len() >= 2 && found.unknown.len() < 2).then_some(found)
    });
    let some = grants(Role::Viewer, &[], &[("north", &[Right::Live, Right::History])]);
    let north = bench.handle.within(some.clone());
    let query = EntityQuery { span: everything(), after: None, limit: 1000 };
    let of_north = north.search_entities("yard", &query).unwrap();
    let cameras = |found: &FoundEntities| {
        let mut ids: Vec<String> = found
            .entities
            .iter()
            .flat_map(|of| &of.path)
            .flat_map(|stand| stand.cameras.iter().map(ToString::to_string))
            .collect();
        ids.sort();
        ids.dedup();
        ids
    };
    assert_eq!(
        (cameras(&all), cameras(&of_north)),
        (vec!["north".into(), "south".into()], vec!["north".into()])
    );
    assert!(of_north.entities.len() >= 2);
    assert!(
        of_north.entities.iter().all(|of| of.id < 64 && (0.3..=3.0).contains(&of.height_m)),
        "ids from 1"
    );
    // Page by page it is the same.
    let (mut paged, mut after) = (Vec::new(), None);
    loop {
        let query = EntityQuery { span: everything(), after, limit: 1 };
        let page = bench.handle.search_entities("yard", &query).unwrap();
        paged.extend(page.entities);
        after = page.next;
        if after.is_none() {
            break;
        }
    }
    assert_eq!(paged, all.entities);
    // All of time takes no longer.
    let span = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
    let ever = bench.handle.search_entities("yard", &EntityQuery { span, after: None, limit: 1000 }).unwrap();
    assert_eq!((ever.entities, ever.unknown.len()), (all.entities.clone(), 2));
    bench.stop();
    // Tracks that are gone since take nobody away: what was concluded is kept.
    let next = Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    next.runtime.block_on(async {
        use sqlx::{Connection, SqliteConnection};
        let url = format!("sqlite://{}", folder.path().join("test.sqlite").display());
        let mut other = SqliteConnection::connect(&url).await.unwrap();
        sqlx::raw_sql("delete from track").execute(&mut other).await.unwrap();
    });
    assert_eq!(paths(&next.handle).entities, all.entities);
    assert_eq!(next.handle.within(some).search_entities("yard", &query).unwrap().entities, of_north.entities);
    next.stop();
}

#[test]
fn zones_that_come_later_hide_who_was_seen_within_them() {
    let folder = tempfile::tempdir().unwrap();
    let bench = start(folder.path(), 10.0);
    watched(&bench);
    let before = paths(&bench.handle);
    let seen_by = |found: &FoundEntities, id: &str| {
        let stands = || found.entities.iter().flat_map(|of| &of.path);
        stands().filter(|stand| stand.cameras.iter().any(|camera| camera.as_str() == id)).count()
    };
    assert!(seen_by(&before, "north") > 10 && seen_by(&before, "south") > 10);
    let hide = |camera: &str, polygon: &[[f64; 2]]| {
        let zones =
            vec![Zone { name: "all".to_owned(), reason: "a test".to_owned(), polygon: polygon.to_vec() }]
                .into();
        bench.handle.hold_privacy(camera, Privacy { zones, version: 1, ..Privacy::default() }).unwrap();
    };
    let whole = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    hide("north", &whole);
    let of_south = paths(&bench.handle);
    assert_eq!(seen_by(&of_south, "north"), 0);
    assert!(seen_by(&of_south, "south") > 10);
    // Whoever walks through a zone is told of before and behind it, and not straight through.
    hide("south", &[[0.4, 0.0], [0.6, 0.0], [0.6, 1.0], [0.4, 1.0]]);
    let parts = paths(&bench.handle);
    let is_parted = |whole: &FoundEntity| {
        let (first, last) = (whole.path[0].at, whole.path[whole.path.len() - 1].at);
        let own = parts.entities.iter().filter(|of| of.id == whole.id);
        own.filter(|of| (first..=last).contains(&of.path[0].at)).count() > 1
    };
    assert!(of_south.entities.iter().any(is_parted), "{parts:#?}");
    hide("south", &whole);
    assert_eq!(paths(&bench.handle).entities, []);
    bench.stop();
}
