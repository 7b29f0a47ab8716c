//! What a caller with some rights is told: nothing of a forbidden camera, and nothing that follows from one.

use super::{Bench, FRAME_NANOS, SCENE, SIZE, at, camera, has_adapter, picture, pictures, request};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use videofields_api as api;
use videofields_picture::plan::{Colors, EntityStyle};
use videofields_recording::accounts::{Accounts, Audit, UserChange};
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{Catalog, Changer, Condition};
use videofields_service::engine::{
    At, Door, EngineError, Flow, Handle, LocateMethod, PlannedView, TrackQuery, ViewKind, ViewRequest,
};
use videofields_vision::access::{Grants, Right, Rights, Role};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{End, Settings};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::CameraId;

/// The same floor without anybody.
fn empty(folder: &Path, name: &str, numbers: std::ops::Range<u32>) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for number in numbers {
        let mut picture = picture(number);
        for (x, y) in (0..SIZE.0).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
            let luma = picture.get_pixel(x, y).0[0];
            picture.put_pixel(x, y, image::Luma([if luma > 200 { 97 } else { luma }]));
        }
        picture.save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

pub(super) fn grants(role: Role, everywhere: &[Right], cameras: &[(&str, &[Right])]) -> Arc<Grants> {
    let of = |(id, rights): &(&str, &[Right])| (CameraId::new(id).unwrap(), Rights::from(rights.to_vec()));
    let cameras: BTreeMap<_, _> = cameras.iter().map(of).collect();
    Arc::new(Grants::new(role, Rights::from(everywhere.to_vec()), cameras))
}

/// A daemon that has seen twenty frames of both cameras, `south` with somebody or without.
pub(super) fn seen(folder: &Path, south_sees_somebody: PathBuf) -> Bench {
    let cameras = [
        camera("north", pictures(folder, "north", 0..20), End::Stop),
        camera("south", south_sees_somebody, End::Stop),
    ];
    let settings = Settings { camera: cameras.to_vec(), ..Settings::default() };
    let bench = Bench::start(folder, settings, &[("yard", SCENE)]);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    bench
}

/// Two daemons, and where their files lie: before `south` is somebody in the one and nobody in the other.
pub(super) fn two_worlds() -> ([TempDir; 2], [Bench; 2]) {
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let [first, second] = folders.each_ref().map(TempDir::path);
    let benches = [seen(first, pictures(first, "south", 0..20)), seen(second, empty(second, "south", 0..20))];
    (folders, benches)
}

/// Removes times that the clock tells and what is drawn by lot, which are not what was seen.
pub(super) fn timeless(text: &str) -> String {
    let mut value: serde_json::Value = serde_json::from_str(text).unwrap();
    fn strip(value: &mut serde_json::Value) {
        match value {
            serde_json::Value::Object(members) => {
                members.retain(|name, _| {
                    ![
                        "since",
                        "age_secs",
                        "expected_ms",
                        "expected_upper_ms",
                        "created_at",
                        "updated_at",
                        "changed_at",
                        "name_ending",
                    ]
                    .contains(&name.as_str())
                });
                members.values_mut().for_each(strip);
            }
            serde_json::Value::Array(values) => values.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut value);
    value.to_string()
}

/// Everything that a caller is told, in words, a line a question; pictures as their bytes.
pub(super) fn told(bench: &Bench, handle: &Handle) -> Vec<String> {
    let mut lines = Vec::new();
    let mut tell = |what: &str, answer: String| lines.push(format!("{what}: {answer}"));
    tell("cameras", timeless(&serde_json::to_string(&handle.cameras()).unwrap()));
    tell("scenes", serde_json::to_string(&handle.scenes()).unwrap());
    for scene in ["yard", "nowhere"] {
        tell("scene", format!("{:?}", handle.scene(scene).map(|scene| scene.document.to_string())));
        let span = (Timestamp::from_nanos(0), Timestamp::from_nanos(FRAME_NANOS * 1000));
        let timeline = handle.scene_timeline(scene, span, 1).map(|found| {
            let events: Vec<_> = found.events.into_iter().map(|logged| logged.event).collect();
            format!("{:?} {events:?}", found.cameras)
        });
        tell("timeline", format!("{timeline:?}"));
        let query = TrackQuery { span, cameras: None, region: None, before: None, limit: 100 };
        tell("tracks", format!("{:?}", handle.search_tracks(scene, &query)));
        let asked = TrackQuery { cameras: Some(vec![CameraId::new("south").unwrap()]), ..query.clone() };
        tell("tracks of south", format!("{:?}", handle.search_tracks(scene, &asked)));
        tell("alignment", format!("{:?}", handle.alignment(scene)));
        tell(
            "left out",
            format!("{} {}", handle.leaves_out(scene, At::Live), handle.leaves_out(scene, at(0))),
        );
    }
    for camera in ["north", "south", "nobody"] {
        for time in [At::Live, at(FRAME_NANOS * 5), at(FRAME_NANOS * 19)] {
            let seen = handle.observation(camera, time).map(|seen| {
                (seen.frame.number, seen.frame.image.to_rgb().data, seen.labels.data.clone(), seen.blobs)
            });
            tell("observation", format!("{seen:?}"));
        }
        let preview = handle.preview(camera, Timestamp::from_nanos(FRAME_NANOS * 7), Duration::from_secs(1));
        tell("preview", format!("{:?}", preview.map(|found| (found.timestamp, found.image.to_rgb().data))));
        let events = handle.events(Some(camera), 0, 100);
        tell(
            "events",
            format!("{:?}", events.map(|all| all.into_iter().map(|e| e.event).collect::<Vec<_>>())),
        );
        for method in [LocateMethod::Ray, LocateMethod::Map] {
            for scene in [None, Some("yard"), Some("nowhere")] {
                let found = handle.locate(camera, glam::DVec2::new(0.5, 0.6), scene, method);
                tell("locate", format!("{found:?}"));
            }
        }
        tell("segment", format!("{:?}", handle.segment_settings(camera)));
        tell("change segment", format!("{:?}", handle.change_segment(camera, json!({"delta": 0.2}))));
        tell("feed", format!("{:?}", handle.feed(camera)));
        let off = json!({"enabled": true});
        tell("change feed", format!("{:?}", handle.change_feed(camera, &off)));
        tell("place", format!("{:?}", handle.accept_place(camera)));
        let export =
            json!({"cameras": [camera], "from": "1970-01-01T00:00:00Z", "to": "1970-01-01T00:00:02Z"});
        tell("export", format!("{:?}", handle.ask_export(export, None)));
    }
    let events = handle.events(None, 0, 100).unwrap();
    tell("all events", format!("{:?}", events.into_iter().map(|e| e.event).collect::<Vec<_>>()));
    tell(
        "playhead",
        format!("{:?}", handle.put_playhead("wall", json!({"at": "1970-01-01T00:00:01Z", "paused": true}))),
    );
    tell("playheads", serde_json::to_string(&handle.playheads()).unwrap());
    tell("readiness", serde_json::to_string(&handle.readiness()).unwrap());
    tell("metrics", format!("{:?}", handle.metrics_text().map(|_| ())));
    for asked in views() {
        let answer = bench.runtime.block_on(handle.view(asked.clone())).map(|answer| {
            let plan = format!("{:?}", answer.plan);
            (answer.image.data.clone(), answer.instant, answer.view, answer.sources, answer.gaps, plan)
        });
        tell("view", format!("{asked:?} {answer:?}"));
        let plan = handle.plan(&asked).map(|plan| PlannedView { expected: None, ..plan });
        tell("plan", format!("{plan:?}"));
    }
    lines
}

/// Views of all kinds, from where both cameras would show somebody.
fn views() -> Vec<ViewRequest> {
    let mut views = Vec::new();
    for time in [At::Live, at(FRAME_NANOS * 12), at(FRAME_NANOS * 19)] {
        for style in [EntityStyle::Billboards, EntityStyle::Points, EntityStyle::None] {
            for colors in [Colors::Even, Colors::Raw] {
                views.push(ViewRequest {
                    style,
                    colors,
                    width_px: 80,
                    height_px: 60,
                    ..request("yard", time)
                });
            }
        }
        views.push(ViewRequest { session: Some("wall".to_owned()), ..request("yard", time) });
        let kind = ViewKind::Map { across_m: None, heading_rad: 0.0 };
        views.push(ViewRequest { kind, eye: None, target: None, ..request("yard", time) });
    }
    views
}

#[test]
fn nothing_that_a_forbidden_camera_sees_reaches_a_caller() {
    if !has_adapter() {
        return;
    }
    let (folders, benches) = two_worlds();
    let both = benches.each_ref();
    // Others look first, so that what they leave behind would show.
    let all = both.map(|bench| told(bench, &bench.handle));
    let n_unlike = all[0].iter().zip(&all[1]).filter(|(a, b)| a != b).count();
    assert!(n_unlike > 20, "{n_unlike} answers tell whether somebody is there");
    for (role, rights) in [
        (Role::Viewer, &[Right::Live, Right::History][..]),
        (Role::Operator, &Right::ALL[..]),
        (Role::Viewer, &[Right::History]),
    ] {
        let grants = grants(role, &[], &[("north", rights)]);
        let [with, without] = both.map(|bench| told(bench, &bench.handle.within(Arc::clone(&grants))));
        // The cameras' files lie in two folders.
        let [with_in, without_in] = folders.each_ref().map(|folder| folder.path().to_str().unwrap());
        let without = without.iter().map(|line| line.replace(without_in, with_in)).collect();
        let answers = [with, without];
        for (with, without) in answers[0].iter().zip(&answers[1]) {
            let at =
                with.bytes().zip(without.bytes()).position(|(a, b)| a != b).unwrap_or(0).saturating_sub(200);
            let part = |of: &str| of.chars().skip(at).take(600).collect::<String>();
            assert!(with == without, "{role:?} is told\n{}\nor\n{}", part(with), part(without));
            // But for what the caller asked for by that name, and the error that says that there is none.
            let echoes =
                ["NoCamera { id: \"south\" }", "unknown camera of the scene `south`", "tracks of south"];
            let said = echoes.iter().fold(with.clone(), |said, echo| said.replace(echo, ""));
            let is_named = said.contains("south");
            assert!(!is_named, "{role:?} learns of the camera: {with:.2000}");
        }
        assert!(answers[0].iter().any(|line| line.starts_with("view") && line.contains("Ok(")), "{role:?}");
    }
}

/// A busy renderer answers those who wait for equal pictures with one: never with one of another caller's cameras.
#[test]
fn who_waits_beside_another_caller_gets_no_picture_of_theirs() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path(), pictures(folder.path(), "south", 0..20));
    let rights: [(&str, &[Right]); 1] = [("north", &Right::ALL)];
    let part = bench.handle.within(grants(Role::Viewer, &[], &rights));
    let asked = || request("yard", at(FRAME_NANOS * 10));
    for round in 0..20 {
        // Something else keeps the renderer busy while both wait, in either order.
        let other = ViewRequest { width_px: 300 + round, height_px: 200, ..asked() };
        let wait = |handle: &Handle, request: ViewRequest| {
            let (reply, answer) = tokio::sync::oneshot::channel();
            Door::view(&**handle, request, Flow::Common.into(), reply).unwrap();
            answer
        };
        let asked = ViewRequest { width_px: 40 + round, ..asked() };
        let first = wait(&bench.handle, other);
        let mut waiting = Vec::new();
        for is_part in if round % 2 == 0 { [false, true] } else { [true, false] } {
            let handle = if is_part { &part } else { &bench.handle };
            waiting.push((is_part, wait(handle, asked.clone())));
        }
        first.blocking_recv().unwrap().unwrap();
        for (is_part, answer) in waiting {
            let shown = answer.blocking_recv().unwrap().unwrap();
            let sources: Vec<_> = shown.sources.iter().map(|of| of.camera.to_string()).collect();
            let expected: &[&str] = if is_part { &["north"] } else { &["north", "south"] };
            assert_eq!(sources, expected, "round {round}");
        }
    }
    bench.stop();
}

#[test]
fn rights_are_of_a_time_and_of_a_camera() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path(), pictures(folder.path(), "south", 0..20));
    let early = at(0);
    let kind = |found: Result<(), EngineError>| found.err().map(|error| error.kind());
    let look = |handle: &Handle, camera: &str, time| kind(handle.observation(camera, time).map(|_| ()));
    let live = bench.handle.within(grants(Role::Viewer, &[], &[("north", &[Right::Live])]));
    assert_eq!(look(&live, "north", At::Live), None);
    // Two seconds of frames: all of it is as good as now.
    assert_eq!(look(&live, "north", early), None);
    let long_ago = At::Time(Timestamp::from_nanos(-20_000_000_000));
    assert_eq!(look(&live, "north", long_ago), Some(ErrorKind::Forbidden));
    assert_eq!(look(&live, "south", At::Live), Some(ErrorKind::NotFound));
    let view = |handle: &Handle, scene, at| {
        kind(bench.runtime.block_on(handle.view(request(scene, at))).map(|_| ()))
    };
    assert_eq!(view(&live, "yard", long_ago), Some(ErrorKind::Forbidden));
    assert_eq!(view(&live, "nowhere", long_ago), Some(ErrorKind::NotFound));
    assert_eq!(kind(live.plan(&request("yard", long_ago)).map(|_| ())), Some(ErrorKind::Forbidden));
    let span = (Timestamp::from_nanos(0), Timestamp::from_nanos(FRAME_NANOS));
    assert_eq!(kind(live.scene_timeline("yard", span, 1).map(|_| ())), Some(ErrorKind::Forbidden));
    assert_eq!(kind(live.alignment("yard").map(|_| ())), Some(ErrorKind::Forbidden));
    let history = bench.handle.within(grants(Role::Viewer, &[], &[("north", &[Right::History])]));
    assert_eq!(look(&history, "north", At::Live), Some(ErrorKind::Forbidden));
    assert_eq!(look(&history, "north", early), None);
    assert_eq!(kind(history.events(Some("north"), 0, 10).map(|_| ())), None);
    assert_eq!(kind(history.events(Some("south"), 0, 10).map(|_| ())), Some(ErrorKind::NotFound));

    let manage = json!({"delta": 0.1});
    let change =
        |handle: &Handle, camera: &str| kind(handle.change_segment(camera, manage.clone()).map(|_| ()));
    assert_eq!(change(&live, "north"), Some(ErrorKind::Forbidden));
    let viewer = bench.handle.within(grants(Role::Viewer, &[Right::Manage], &[]));
    assert_eq!(change(&viewer, "north"), Some(ErrorKind::Forbidden), "a viewer changes nothing");
    let operator = bench.handle.within(grants(Role::Operator, &[], &[("north", &[Right::Manage])]));
    assert_eq!(change(&operator, "north"), None);
    assert_eq!(change(&operator, "south"), Some(ErrorKind::NotFound));

    let everywhere = bench.handle.within(grants(Role::Viewer, &[Right::Live], &[]));
    assert_eq!(everywhere.cameras().len(), 2);
    assert!(everywhere.metrics_text().is_ok());
    assert_eq!(kind(live.metrics_text().map(|_| ())), Some(ErrorKind::Forbidden));
    assert!(live.leaves_out("yard", At::Live) && !everywhere.leaves_out("yard", At::Live));
    assert!(everywhere.leaves_out("yard", early), "without the right to history");
    let nothing = bench.handle.within(Arc::new(Grants::nothing()));
    assert!(nothing.cameras().is_empty() && nothing.scenes().is_empty());
    assert_eq!(kind(nothing.scene("yard").map(|_| ())), Some(ErrorKind::NotFound));
    assert_eq!(nothing.readiness().cameras_with_frames, [0, 0]);
    assert_eq!(kind(viewer.put_playhead("a", json!({})).map(|_| ())), Some(ErrorKind::Forbidden));
    assert_eq!(kind(operator.put_playhead("a", json!({})).map(|_| ())), None);
}

#[test]
fn a_playhead_of_a_hidden_scene_is_not_there_and_names_no_scene() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path(), pictures(folder.path(), "south", 0..3));
    bench.handle.put_playhead("wall", json!({"paused": true})).unwrap();
    let stranger = bench.handle.within(grants(Role::Operator, &[], &[("elsewhere", &Right::ALL)]));
    assert!(stranger.playheads().is_empty());
    let position = stranger.playhead_at("wall").map(|_| ());
    let change = stranger.change_playhead("wall", json!({"paused": false})).map(|_| ());
    let moved = stranger.change_playhead("wall", json!({"scene": "yard"})).map(|_| ());
    for found in
        [stranger.playhead("wall").map(|_| ()), position, change, moved, stranger.remove_playhead("wall")]
    {
        let error = found.unwrap_err();
        assert!(error.kind() == ErrorKind::NotFound && !error.to_string().contains("yard"), "{error}");
    }
    let taken = stranger.put_playhead("wall", json!({"scene": "yard"})).unwrap_err();
    assert!(taken.kind() == ErrorKind::Forbidden && !taken.to_string().contains("yard"), "{taken}");
    assert_eq!(bench.handle.playheads().len(), 1);
}

/// Every route, with ids of what is permitted, what is forbidden and what is not there.
fn routes() -> Vec<String> {
    let mut routes: Vec<String> = [
        "/healthz",
        "/readyz",
        "/metrics",
        "/",
        "/api/v1/cameras",
        "/api/v1/scenes",
        "/api/v1/events",
        "/api/v1/events?camera=south",
        "/api/v1/events?camera=nobody",
        "/api/v1/exports",
        "/api/v1/exports/none",
        "/api/v1/exports/none/manifest.json",
        "/api/v1/playheads",
        "/api/v1/playheads/wall",
        "/api/v1/playheads/none",
        "/api/v1/session",
        "/api/v1/audit",
        "/api/v1/users",
        "/api/v1/users/guest",
        "/api/v1/users/root",
        "/api/v1/tokens",
        "/api/v1/nothing",
        "/api/v1/scenes/yard/versions",
        "/api/v1/walls",
        "/api/v1/walls/control",
        "/api/v1/walls/control/versions",
        "/api/v1/walls/control/tiles",
        "/api/v1/walls/control/tiles/r1c1/frame.png",
        "/api/v1/walls/control/tiles/r1c2/frame.jpg",
        "/api/v1/walls/control/tiles/r1c2/frame.png?pattern=identify",
        "/api/v1/walls/control/tiles/r9c9/frame.png",
        "/api/v1/walls/past/tiles/r1c1/frame.png",
        "/api/v1/walls/none",
        "/api/v1/views",
        "/api/v1/views/gate",
        "/api/v1/views/gate/versions",
        "/api/v1/views/gate/picture.png?width=64&height=48",
        "/api/v1/views/past/picture.jpg?width=64&height=48",
        "/api/v1/views/none/picture.jpg",
    ]
    .map(str::to_owned)
    .into();
    for camera in ["north", "south", "nobody"] {
        let of = format!("/api/v1/cameras/{camera}");
        let span = "from=1970-01-01T00:00:00Z&to=1970-01-01T00:00:01Z";
        routes.extend([
            of.clone(),
            format!("{of}/segment"),
            format!("{of}/source"),
            format!("{of}/privacy"),
            format!("{of}/locate?u=0.5&v=0.6"),
            format!("{of}/locate?u=0.5&v=0.6&scene=yard&method=map"),
            format!("{of}/strip.jpg?{span}&count=3"),
        ]);
        for kind in ["frame", "background", "mask"] {
            for time in ["live", "100000000", "1970-01-01T00:00:00.3Z", "playhead:wall"] {
                routes.push(format!("{of}/{kind}.png?t={time}"));
            }
            routes.push(format!("{of}/{kind}.jpg"));
        }
    }
    for scene in ["yard", "nowhere"] {
        let of = format!("/api/v1/scenes/{scene}");
        let span = "from=1970-01-01T00:00:00Z&to=1970-01-01T00:00:01Z";
        routes.extend([of.clone(), format!("{of}/alignment"), format!("{of}/timeline?{span}")]);
        routes.push(format!("{of}/which-cameras?point=0,0,0"));
        routes.extend(
            ["entities", "entities?t=200000000", "entities/1/hull.glb", "entities/2/hull.ply?t=200000000"]
                .map(|rest| format!("{of}/{rest}")),
        );
        routes.extend(
            ["", "&camera=south", "&camera=north"].map(|of_camera| format!("{of}/tracks?{span}{of_camera}")),
        );
        for what in ["view.png", "view.jpg", "plan"] {
            for wishes in [
                "",
                "&entities=points",
                "&quality=draft",
                "&quality=exact&colors=raw",
                "&session=wall",
                "&t=200000000",
                "&t=playhead:wall&see_through=off",
                "&projection=map",
                "&projection=stereo",
            ] {
                routes.push(format!("{of}/{what}?width=64&height=48{wishes}"));
            }
        }
    }
    routes
}

/// Walls and views: of each one that is live and one that shows what a playhead does; and a wall of a scene that may be hidden.
pub(super) async fn walls(bench: &Bench, clock: &Arc<dyn Clock>) -> Catalog {
    let folders = (PathBuf::from("."), Vec::new());
    let catalog = Catalog::open(bench.store.clone(), Arc::clone(clock), Vec::new(), folders).await.unwrap();
    for (id, scene, playhead) in
        [("control", "yard", None), ("past", "yard", Some("wall")), ("hidden", "hidden", None)]
    {
        let wall = json!({
            "scene": scene,
            "playhead": playhead,
            "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]},
            "surface": {"grid": {"columns": 2, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
        });
        if !catalog.state(DocumentKind::Wall, id).is_there {
            let kept = catalog.put(
                (DocumentKind::Wall, id),
                wall.to_string(),
                Condition::Absent,
                Changer::anybody(),
            );
            kept.await.unwrap();
        }
    }
    for (id, parameters) in [("gate", "eye=7,-7,5&target=0,0,0"), ("past", "t=playhead:wall")] {
        let view = json!({"scene": "yard", "parameters": parameters});
        if !catalog.state(DocumentKind::View, id).is_there {
            let kept = catalog.put(
                (DocumentKind::View, id),
                view.to_string(),
                Condition::Absent,
                Changer::anybody(),
            );
            kept.await.unwrap();
        }
    }
    catalog
}

/// The interface of a daemon that has users.
pub(super) fn router(bench: &Bench) -> axum::Router {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let catalog = Arc::new(bench.runtime.block_on(walls(bench, &clock)));
    router_over(bench, catalog)
}

/// The interface over what a catalog keeps.
pub(super) fn router_over(bench: &Bench, catalog: Arc<Catalog>) -> axum::Router {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    bench.runtime.block_on(async {
        let accounts = Accounts::open(bench.store.clone(), Arc::clone(&clock)).await.unwrap();
        let audit = Arc::new(Audit::new(bench.store.clone()));
        let trust = api::Trust { accounts: Arc::new(accounts), audit, catalog, snapshots: None };
        api::router(bench.handle.clone(), trust, clock, api::Site::default())
    })
}

/// Tokens of an admin and of an operator who may see `north` alone.
pub(super) fn users(bench: &Bench) -> [String; 2] {
    bench.handle.put_playhead("wall", json!({"at": "1970-01-01T00:00:00.2Z", "paused": true})).unwrap();
    accounts(bench)
}

/// The same, without a playhead.
pub(super) fn accounts(bench: &Bench) -> [String; 2] {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    bench.runtime.block_on(async {
        let accounts = Accounts::open(bench.store.clone(), clock).await.unwrap();
        let user = |body| UserChange::read(body).unwrap();
        let admin = user(json!({"role": "admin", "password": "a long password"}));
        accounts.put_user("root", admin, None).await.unwrap();
        let guest = user(json!({"role": "operator", "cameras": {"north": ["live", "history", "export"]}}));
        accounts.put_user("guest", guest, None).await.unwrap();
        let token = async |user| accounts.add_token(user, String::new(), None).await.unwrap().1;
        [token("root").await, token("guest").await]
    })
}

/// What a daemon answers over HTTP, times aside: a line of status, fields and body for each route.
pub(super) fn answered(bench: &Bench, token: &str) -> Vec<(String, String, Vec<u8>)> {
    use axum::body::{Body, to_bytes};
    use tower::ServiceExt;
    let router = router(bench);
    bench.runtime.block_on(async {
        let mut answers = Vec::new();
        for route in routes() {
            let request = axum::http::Request::get(&route).header("authorization", format!("Bearer {token}"));
            let response = router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap();
            let (parts, body) = response.into_parts();
            // What a stage took, was expected to take, or how old something is: times.
            let times =
                ["server-timing", "videofields-age", "videofields-expected", "videofields-wall-frame"];
            let is_json = parts.headers.get("content-type").is_some_and(|kind| kind == "application/json");
            // A time is as long as its digits.
            let is_time = |name: &str| times.contains(&name) || (is_json && name == "content-length");
            let fields = parts.headers.iter().filter(|(name, _)| !is_time(name.as_str()));
            let fields: Vec<String> = fields.map(|(name, value)| format!("{name}: {value:?}")).collect();
            let body = to_bytes(body, 1 << 24).await.unwrap().to_vec();
            let body =
                if is_json { timeless(std::str::from_utf8(&body).unwrap()).into_bytes() } else { body };
            answers.push((route, format!("{} {}", parts.status, fields.join("; ")), body));
        }
        answers
    })
}

#[test]
fn no_route_tells_a_byte_of_a_forbidden_camera() {
    if !has_adapter() {
        return;
    }
    let (_folders, benches) = two_worlds();
    let both = benches.each_ref();
    let tokens = both.map(users);
    // An admin looks at everything first, at all of what caches could keep.
    let all = [0, 1].map(|idx| answered(both[idx], &tokens[idx][0]));
    let n_unlike = all[0].iter().zip(&all[1]).filter(|(a, b)| a.2 != b.2).count();
    assert!(n_unlike > 20, "{n_unlike} answers tell whether somebody is there");
    let mine = [0, 1].map(|idx| answered(both[idx], &tokens[idx][1]));
    let mut n_told = 0;
    for ((route, head, body), (_, other_head, other_body)) in mine[0].iter().zip(&mine[1]) {
        // Tokens are random.
        let is_own = route == "/api/v1/tokens";
        let is_alike = head == other_head && (body == other_body || is_own);
        let shown = |body: &[u8]| String::from_utf8_lossy(&body[..body.len().min(400)]).into_owned();
        assert!(is_alike, "{route}: {head}\n{}\nor {other_head}\n{}", shown(body), shown(other_body));
        n_told += usize::from(head.starts_with("200"));
        let asks_for_it = route.contains("south");
        let is_named = format!("{head}{}", String::from_utf8_lossy(body)).contains("south");
        assert!(asks_for_it || !is_named, "{route} names the camera: {head} {}", shown(body));
        assert!(!asks_for_it || head.starts_with("404") || route.contains("tracks"), "{route}: {head}");
    }
    assert!(n_told > 50, "{n_told} routes were answered");
}
