//! What nobody may see of a camera: nothing of it comes out anywhere, whatever is seen there.

use super::house::House;
use super::rights::{answered, told};
use super::{Bench, FRAME_NANOS, SCENE, SIZE, at, camera, has_adapter, picture, pictures, request};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use videofields_recording::accounts::{Accounts, UserChange};
use videofields_service::catalog::Catalog;
use videofields_service::engine::{At, Privacy};
use videofields_testing::wait_for;
use videofields_vision::access::{Grants, Right, Rights, Role};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{CameraSettings, End, EntitySettings, Settings};
use videofields_vision::frame::{CameraId, NEUTRAL_YUV, YuvImage, Zone};
use videofields_vision::observation::Observation;

/// Something of the right half, at odd places.
pub(crate) const RIGHT: [[f64; 2]; 4] = [[0.53, 0.0], [1.0, 0.0], [1.0, 1.0], [0.61, 1.0]];

pub(crate) fn zone(name: &str, polygon: &[[f64; 2]]) -> Zone {
    Zone { name: name.to_owned(), reason: "a neighbour's garden".to_owned(), polygon: polygon.to_vec() }
}

/// Pictures that differ from those of [`pictures`] within the zone alone: there all is turned around.
pub(crate) fn others(folder: &Path, name: &str, numbers: std::ops::Range<u32>, zone: &Zone) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for number in numbers {
        let mut picture = picture(number);
        for (x, y) in (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
            // Whole pixels: chroma is grey in any case.
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
            let place = |(right, down)| {
                [(f64::from(x) + right) / f64::from(SIZE.0), (f64::from(y) + down) / f64::from(SIZE.1)]
            };
            if corners.into_iter().all(|corner| zone.holds(place(corner))) {
                let luma = picture.get_pixel(x, y).0[0];
                picture.put_pixel(x, y, image::Luma([255 - luma]));
            }
        }
        picture.save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

fn hiding(camera: CameraSettings, zones: &[Zone]) -> CameraSettings {
    CameraSettings { privacy_zones: zones.to_vec(), ..camera }
}

fn token(bench: &Bench) -> String {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    bench.handle.put_playhead("wall", json!({"at": "1970-01-01T00:00:00.2Z", "paused": true})).unwrap();
    bench.runtime.block_on(async {
        let accounts = Accounts::open(bench.store.clone(), clock).await.unwrap();
        let admin = UserChange::read(json!({"role": "admin", "password": "a long password"})).unwrap();
        accounts.put_user("root", admin, None).await.unwrap();
        accounts.add_token("root", String::new(), None).await.unwrap().1
    })
}

#[test]
fn two_worlds_that_differ_within_a_zone_alone_are_told_alike_to_the_byte() {
    if !has_adapter() {
        return;
    }
    let zone = zone("garden", &RIGHT);
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let [first, second] = folders.each_ref().map(TempDir::path);
    let start = |folder: &Path, south: PathBuf| {
        let north = camera("north", pictures(folder, "north", 0..20), End::Stop);
        let south = hiding(camera("south", south, End::Stop), std::slice::from_ref(&zone));
        // People are placed when they are asked for: placed as they walk, they would depend on how fast this machine is.
        let settings = Settings {
            camera: vec![north, south],
            entities: EntitySettings { rate_hz: 0.0 },
            ..Settings::default()
        };
        let bench = Bench::start(folder, settings, &[("yard", SCENE)]);
        for id in ["north", "south"] {
            bench.wait_for_state(id, "ended");
        }
        bench
    };
    let benches =
        [start(first, pictures(first, "south", 0..20)), start(second, others(second, "south", 0..20, &zone))];
    let in_first = |line: &String| line.replace(second.to_str().unwrap(), first.to_str().unwrap());
    let [one, other] = benches.each_ref().map(|bench| told(bench, &bench.handle));
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(other.iter().map(in_first)) {
        assert!(*one == other, "{one:.2000}\nor\n{other:.2000}");
    }
    assert!(one.iter().any(|line| line.starts_with("view") && line.contains("Ok(")));
    let [one, other] = benches.each_ref().map(|bench| answered(bench, &token(bench)));
    let mut n_told = 0;
    for ((route, head, body), (_, other_head, other_body)) in one.iter().zip(&other) {
        let is_alike = head == other_head && body == other_body;
        // Tokens are random, and files lie in two folders.
        let is_own =
            ["/api/v1/tokens", "/source", "/metrics", "/audit"].iter().any(|own| route.contains(own));
        assert!(is_alike || is_own, "{route}: {head} or {other_head}");
        n_told += usize::from(head.starts_with("200"));
    }
    assert!(n_told > 50, "{n_told} routes were answered");
    // What is kept on the disk, too.
    let south = CameraId::new("south").unwrap();
    let [one, other] = benches.map(|bench| {
        let runtime = bench.runtime.handle().clone();
        let store = bench.store.clone();
        bench.engine.stop();
        let background = runtime.block_on(store.latest_background(&south)).unwrap().unwrap();
        let span = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
        let tracks = runtime.block_on(store.tracks(&south, span, None, 100)).unwrap();
        let activity = runtime.block_on(store.activity(&south, span.0, span.1, 1)).unwrap();
        (background.bytes, tracks, activity)
    });
    assert!(!one.0.is_empty() && one == other);
}

/// Whether a picture shows nothing of the zone.
pub(crate) fn hides(image: &YuvImage, zone: &Zone) -> bool {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let middle = |x: u32, y: u32| [(f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height];
    let mut pixels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    pixels.all(|(x, y)| {
        let codes = [0, 1, 2].map(|plane| {
            let half = u32::from(plane > 0);
            image.plane(plane).row(y >> half)[(x >> half) as usize]
        });
        !zone.holds(middle(x, y)) || codes == NEUTRAL_YUV
    })
}

fn check_hidden(seen: &Observation, zone: &Zone) {
    assert!(hides(&seen.frame.image, zone) && hides(&seen.background, zone), "{:?}", seen.frame.timestamp);
    let (width, height) = (seen.labels.width, seen.labels.height);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let middle = [(f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height)];
        let is_still = seen.labels.get(x, y) == 0 && seen.soft_mask.get(x, y) == 0;
        assert!(is_still || !zone.holds(middle), "{x} {y}");
    }
}

#[test]
fn a_zone_that_is_added_hides_what_memory_holds_and_lifting_it_shows_what_comes_alone() {
    let folder = TempDir::new().unwrap();
    let path = pictures(folder.path(), "north", 0..24);
    let settings = Settings { camera: vec![camera("north", path.clone(), End::Stop)], ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[]);
    bench.wait_for_state("north", "ended");
    let zone = zone("garden", &RIGHT);
    let seen = |number: i64| bench.handle.observation("north", at(number * FRAME_NANOS)).unwrap();
    let before: Vec<_> = (0..24).map(seen).collect();
    assert!(before.iter().any(|seen| !seen.blobs.is_empty()) && !hides(&before[5].frame.image, &zone));
    let hold = |zones: &[Zone], version| {
        let privacy = Privacy { zones: zones.into(), version, ..Privacy::default() };
        bench.handle.hold_privacy("north", privacy).unwrap();
    };
    hold(std::slice::from_ref(&zone), 1);
    for (number, before) in before.iter().enumerate() {
        let now = seen(number as i64);
        assert_eq!(now.frame.timestamp, before.frame.timestamp);
        check_hidden(&now, &zone);
        // What is not hidden is as it was.
        assert_eq!(now.frame.image.plane(0).row(10)[..32], before.frame.image.plane(0).row(10)[..32]);
        for blob in now.blobs.iter() {
            let (columns, rows) =
                (blob.rect.x..blob.rect.x + blob.rect.width, blob.rect.y..blob.rect.y + blob.rect.height);
            let middle = |x: u32, y: u32| {
                [(f64::from(x) + 0.5) / f64::from(SIZE.0), (f64::from(y) + 0.5) / f64::from(SIZE.1)]
            };
            assert!(!rows.clone().any(|y| columns.clone().any(|x| zone.holds(middle(x, y)))), "{blob:?}");
        }
        let shown = |track: &videofields_vision::track::Track| {
            track.blob_idx.is_none_or(|idx| (idx as usize) < now.blobs.len())
        };
        assert!(now.tracks.iter().all(shown));
    }
    assert_eq!(bench.summary("north").privacy.zones, 1);
    let metrics = bench.handle.metrics_text().unwrap();
    assert!(metrics.contains("videofields_camera_privacy_zones{camera=\"north\"} 1"), "{metrics}");
    // Lifted, what was taken before stays as it is.
    hold(&[], 2);
    for number in 0..24 {
        check_hidden(&seen(number), &zone);
    }
    // What comes is seen: the source begins anew.
    let feed = json!({"source": {"path": path, "rate_hz": 50.0, "start": "1970-01-01T00:01:00Z"}});
    bench.handle.change_feed("north", &feed).unwrap();
    let minute = Timestamp::from_nanos(60_000_000_000);
    let shown = wait_for("new pictures", || {
        let seen = bench.handle.observation("north", At::Live).ok()?;
        (seen.frame.timestamp >= minute).then_some(seen)
    });
    assert!(!hides(&shown.frame.image, &zone));
    bench.stop();
}

#[test]
fn a_camera_that_runs_on_shows_nothing_hidden_from_the_answer_on() {
    let folder = TempDir::new().unwrap();
    let path = pictures(folder.path(), "north", 0..24);
    let settings = Settings { camera: vec![camera("north", path, End::Loop)], ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[]);
    let zones = [zone("right", &RIGHT), zone("left", &[[0.0, 0.0], [0.3, 0.0], [0.3, 1.0], [0.0, 1.0]])];
    wait_for("pictures", || (bench.summary("north").frames > 30).then_some(()));
    for round in 0..30 {
        let own = &zones[round % 2];
        let privacy =
            Privacy { zones: vec![own.clone()].into(), version: round as i64 + 1, ..Privacy::default() };
        bench.handle.hold_privacy("north", privacy).unwrap();
        // The newest, the oldest, and what comes.
        let first = bench.summary("north").first.unwrap().parse::<Timestamp>().unwrap();
        check_hidden(&bench.handle.observation("north", At::Live).unwrap(), own);
        check_hidden(&bench.handle.observation("north", At::Time(first)).unwrap(), own);
        let last = bench.summary("north").frames;
        wait_for("more", || (bench.summary("north").frames > last + 2).then_some(()));
        let seen = bench.handle.observation("north", At::Live).unwrap();
        check_hidden(&seen, own);
        assert!(!hides(&seen.frame.image, &zones[1 - round % 2]), "the other is lifted");
    }
    bench.stop();
}

#[test]
fn what_a_camera_hides_others_show_and_nobody_a_grey() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let whole = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let cameras = vec![
        hiding(camera("north", pictures(folder.path(), "north", 0..20), End::Stop), &[zone("all", &whole)]),
        camera("south", pictures(folder.path(), "south", 0..20), End::Stop),
    ];
    let bench =
        Bench::start(folder.path(), Settings { camera: cameras, ..Settings::default() }, &[("yard", SCENE)]);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    let asked = || request("yard", at(FRAME_NANOS * 12));
    let both = bench.view(asked()).unwrap();
    let rights = Rights::from(Right::ALL.to_vec());
    let south = [(CameraId::new("south").unwrap(), rights)].into();
    let alone = bench.handle.within(Arc::new(Grants::new(Role::Viewer, Rights::default(), south)));
    let alone = bench.runtime.block_on(alone.view(asked())).unwrap();
    assert_eq!((both.sources.len(), alone.sources.len()), (2, 1));
    // As if the camera that sees nothing were not there; but surfaces are cut into other patches.
    let pairs = both.image.data.iter().zip(&alone.image.data);
    let n_unlike = pairs.filter(|(one, other)| one.abs_diff(**other) > 2).count();
    assert!(n_unlike * 50 < both.image.data.len(), "{n_unlike} of {} differ", both.image.data.len());
    let neutral = YuvImage::filled(
        1,
        1,
        NEUTRAL_YUV,
        videofields_vision::frame::ColorMatrix::Bt601,
        videofields_vision::frame::ColorRange::Full,
    );
    let grey = neutral.to_rgb().data;
    assert!(!both.image.data.chunks_exact(3).any(|pixel| pixel == grey), "{grey:?} is projected");
    bench.stop();
}

/// The configuration is read again, and has another source and another zone: no picture of the one without the other.
#[test]
fn zones_of_a_configuration_that_is_read_again_hold_before_its_sources_are_changed() {
    let folder = TempDir::new().unwrap();
    let path = pictures(folder.path(), "north", 0..24);
    let north = camera("north", path, End::Loop);
    let settings = Settings { camera: vec![north], ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[]);
    wait_for("pictures", || (bench.summary("north").frames > 10).then_some(()));
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let folders = (PathBuf::from("."), Vec::new());
    let own = zone("garden", &RIGHT);
    let other = pictures(folder.path(), "other", 30..40);
    let moved = camera("north", other, End::Loop);
    let again =
        [hiding(moved, std::slice::from_ref(&own)), hiding(camera("late", "late.webm", End::Stop), &[])];
    let reloader = bench.engine.reloader();
    let mut settings = Settings::default();
    settings.media.roots = vec![folder.path().to_owned()];
    let followed = bench.runtime.block_on(async {
        let catalog = Catalog::open(bench.store.clone(), clock, Vec::new(), folders).await.unwrap();
        catalog.begin_privacy(&[camera("north", "north", End::Loop)]).await.unwrap();
        let applied =
            catalog.reconfigure((&again, Vec::new(), Vec::new().into()), &[], |cameras, zones, _| {
                let zones_of = |camera: &CameraSettings| zones[&camera.id].zones.len();
                let failed =
                    tokio::task::block_in_place(|| reloader.apply_cameras(&cameras, zones, &settings));
                assert!(failed.is_empty(), "{failed:?}");
                again.iter().map(zones_of).collect::<Vec<_>>()
            });
        applied.await.unwrap()
    });
    assert_eq!(followed, [1, 0]);
    let frames = bench.summary("north").frames;
    wait_for("more", || (bench.summary("north").frames > frames + 10).then_some(()));
    let first = bench.summary("north").first.unwrap().parse::<Timestamp>().unwrap();
    check_hidden(&bench.handle.observation("north", At::Time(first)).unwrap(), &own);
    check_hidden(&bench.handle.observation("north", At::Live).unwrap(), &own);
    bench.stop();
}

const NOTHING: &str = r#"{"version": 1}"#;

#[test]
fn zones_are_changed_over_http_with_versions_and_outlive_the_daemon() {
    let folder = TempDir::new().unwrap();
    let path = pictures(folder.path(), "north", 0..10);
    let start = || {
        let settings =
            Settings { camera: vec![camera("north", path.clone(), End::Stop)], ..Settings::default() };
        House::over(folder.path(), Bench::start(folder.path(), settings, &[]), ("yard", NOTHING))
    };
    let house = start();
    let of = "/api/v1/cameras/north/privacy";
    let tag = |tag: &'static str| Some(("if-match", tag));
    let absent = Some(("if-none-match", "*"));
    let garden = json!({"zones": [{"name": "garden", "reason": "not ours", "polygon": RIGHT}]}).to_string();
    let none = house.get(of);
    assert_eq!((none.status, none.etag.as_deref(), &none.body["zones"]), (200, Some("\"0\""), &json!([])));
    assert_eq!(house.send("PUT", of, None, &garden).status, 428);
    assert_eq!(house.send("PUT", of, tag("\"7\""), &garden).status, 412);
    assert_eq!(house.send("DELETE", of, tag("\"0\""), "").status, 409, "there is nothing to be taken away");
    let first = house.send("PUT", of, absent, &garden);
    assert_eq!((first.status, first.etag.as_deref()), (200, Some("\"1\"")), "{}", first.body);
    assert_eq!((&first.body["is_configured"], &first.body["version"]), (&json!(false), &json!(1)));
    assert_eq!(house.send("PUT", of, absent, &garden).status, 412);
    assert_eq!(house.get("/api/v1/cameras/north").body["privacy"]["zones"], 1);
    // Faults are told at their places, and change nothing.
    let faulty =
        json!({"zones": [{"name": "a", "reason": "b", "polygon": [[0, 0], [2, 0], [1, 1]]}], "more": 1});
    let refused = house.send("PUT", of, tag("\"1\""), &faulty.to_string());
    assert_eq!(refused.status, 400, "{}", refused.body);
    assert!(refused.body["errors"][0]["pointer"].is_string(), "{}", refused.body);
    assert_eq!(house.send("PUT", "/api/v1/cameras/west/privacy", absent, &garden).status, 404);
    let more = json!({"zones": [
        {"name": "garden", "reason": "not ours", "polygon": RIGHT},
        {"name": "door", "reason": "a private door", "polygon": [[0.1, 0.1], [0.2, 0.1], [0.2, 0.3]]},
    ]});
    let second = house.send("PATCH", of, tag("\"1\""), &more.to_string());
    assert_eq!((second.status, second.body["zones"].as_array().unwrap().len()), (200, 2), "{}", second.body);
    let House { bench, .. } = house;
    bench.stop();

    let house = start();
    let kept = house.get(of);
    assert_eq!((kept.etag.as_deref(), kept.body["zones"].as_array().unwrap().len()), (Some("\"2\""), 2));
    let gone = house.send("DELETE", of, tag("\"2\""), "");
    assert_eq!((gone.status, gone.etag.as_deref()), (200, Some("\"3\"")), "{}", gone.body);
    assert_eq!((&gone.body["zones"], &gone.body["is_configured"]), (&json!([]), &json!(true)));
    assert_eq!(gone.body["lifted"].as_array().unwrap().len(), 2);
    assert_eq!(house.get("/api/v1/cameras/north").body["privacy"]["zones"], 0);
    let House { bench, .. } = house;
    bench.stop();
}
