//! Sources: administrators name them, others learn nothing of where they lie, and zones hold wherever the same footage is shown.

use super::privacy::{RIGHT, hides, zone};
use super::rights::grants;
use super::{Bench, camera, pictures, wait_for};
use serde_json::json;
use std::path::Path;
use videofields_service::engine::{At, EngineError, Handle, Privacy};
use videofields_vision::access::{Right, Role};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraUrl, End, Settings, SourceSettings};
use videofields_vision::frame::Zone;

const OFFER: [Right; 3] = [Right::Live, Right::History, Right::Manage];

const EACH: [&str; 2] = ["north", "south"];

fn operator(bench: &Bench) -> Handle {
    bench.handle.within(grants(Role::Operator, &[], &[("north", &OFFER), ("south", &OFFER)]))
}

#[test]
fn who_may_manage_a_camera_may_not_name_what_feeds_it() {
    let folder = tempfile::tempdir().unwrap();
    let [own, other] = ["north", "gate"].map(|name| pictures(folder.path(), name, 0..6));
    let cameras = vec![camera("north", &own, End::Loop), camera("gate", &other, End::Loop)];
    let bench = Bench::start(folder.path(), Settings { camera: cameras, ..Settings::default() }, &[]);
    let (admin, operator) = (&bench.handle, operator(&bench));
    let before = admin.feed("north").unwrap();
    for source in [
        json!({"path": other}),
        json!({"path": folder.path().join("test.sqlite")}),
        json!({"path": null, "url": "rtsp://127.0.0.1:22/", "from_secs": null, "end": null, "pace": null, "start": null, "rate_hz": null}),
        json!({"path": null, "device": "/dev/video0", "from_secs": null, "end": null, "pace": null, "start": null}),
        // Times are part of it: recordings lie there by these.
        json!({"start": "2100-01-01T00:00:00Z"}),
        json!({"start": null}),
        json!({"pace": "all", "end": "stop"}),
        json!({"timing": "index"}),
        json!({"rate_hz": 0.01}),
        json!({"from_secs": 0.02}),
        json!({"until_secs": 0.1}),
    ] {
        let asked = json!({"source": source});
        for refused in [operator.preview_feed("north", &asked), operator.change_feed("north", &asked)] {
            let refused = refused.unwrap_err();
            let EngineError::Forbidden(message) = &refused else { panic!("{asked}: {refused}") };
            assert!(message.contains("admin"), "{message}");
        }
    }
    let elsewhere = admin.preview_feed("north", &json!({"source": {"path": other}})).unwrap();
    assert!(matches!(operator.set_feed("north", elsewhere.clone()), Err(EngineError::Forbidden(_))));
    assert!(matches!(operator.check_feed("gate", &before), Err(EngineError::NoCamera { .. })));
    assert_eq!(admin.feed("north").unwrap(), before);
    for clock in [
        json!({"offset_secs": 2.4e9}),
        json!({"offset_secs": -100_000}),
        json!({"drift_ppm": 2000}),
        json!({"drift_ppm": 1000, "since": "1970-01-01T00:00:00Z"}),
    ] {
        let refused = operator.change_feed("north", &json!({"clock": clock})).unwrap_err();
        assert!(
            matches!(&refused, EngineError::Forbidden(why) if why.contains("admin")),
            "{clock}: {refused}"
        );
        assert_eq!(admin.feed("north").unwrap(), before);
    }
    // All else of it is the operator's; a clock that an admin set so stays.
    for asked in [
        json!({"enabled": false}),
        json!({"enabled": true, "source": {"end": "stop", "path": own}}),
        json!({"clock": {"offset_secs": -3600, "drift_ppm": 40}}),
        json!({"clock": {"offset_secs": 0, "drift_ppm": 0}}),
    ] {
        operator.change_feed("north", &asked).unwrap();
    }
    let odd = json!({"clock": {"offset_secs": 2.4e9}});
    admin.change_feed("north", &odd).unwrap();
    operator.change_feed("north", &json!({"enabled": true, "source": {"end": "loop"}})).unwrap();
    assert_eq!(admin.feed("north").unwrap().clock.offset_secs, 2.4e9);
    assert_eq!(admin.set_feed("north", elsewhere.clone()).unwrap(), elsewhere);
    bench.stop();
}

#[test]
fn addresses_and_what_answers_there_are_told_to_administrators_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut south = camera("south", "none", End::Loop);
    south.source =
        SourceSettings { url: Some(CameraUrl::new("rtsp://127.0.0.1:9/live")), ..SourceSettings::default() };
    let north = camera("north", folder.path().join("hidden-name.webm"), End::Loop);
    let settings = Settings { camera: vec![north, south], ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[]);
    let operator = operator(&bench);
    for (id, address, told) in [
        ("south", "127.0.0.1:9", "it cannot be connected"),
        ("north", "hidden-name", "its file cannot be played"),
    ] {
        let reason = bench.wait_for_state(id, "failed").reason.unwrap();
        assert!(reason.contains(address), "{reason}");
        let told_of = |camera: &str| {
            operator
                .cameras()
                .into_iter()
                .find(|of| of.id.as_str() == camera)
                .and_then(|of| of.reason)
                .unwrap()
        };
        assert_eq!(told_of(id), format!("{told}; administrators see more"));
        let missing = operator.observation(id, At::Live).unwrap_err().to_string();
        assert!(missing.contains(told) && !missing.contains(address), "{missing}");
    }
    bench.stop();
}

fn garden() -> Zone {
    zone("garden", &RIGHT)
}

/// Returns true where the garden of a camera's newest picture is hidden.
fn is_hidden(bench: &Bench, camera: &str) -> bool {
    hides(&bench.handle.observation(camera, At::Live).unwrap().frame.image, &garden())
}

#[test]
fn zones_hold_wherever_the_same_footage_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| pictures(folder.path(), name, 0..6);
    let (own, other) = (place("north"), place("other"));
    std::os::unix::fs::symlink(folder.path().join("north"), folder.path().join("link")).unwrap();
    let again = folder.path().join("link/in%04d.png");
    let cameras = [("north", &own), ("south", &again), ("other", &other)];
    let camera = cameras.map(|(id, path): (&str, &std::path::PathBuf)| camera(id, path, End::Loop)).to_vec();
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[]);
    let door = &bench.handle;
    for id in ["north", "south", "other"] {
        bench.wait_for_state(id, "live");
        assert!(!is_hidden(&bench, id), "{id}");
    }
    let held = Privacy { zones: vec![garden()].into(), version: 1, ..Privacy::default() };
    door.hold_privacy("north", held).unwrap();
    // From the moment on at which the change is acknowledged, in memory too.
    assert!(is_hidden(&bench, "north") && is_hidden(&bench, "south") && !is_hidden(&bench, "other"));
    assert_eq!(door.hidden("south", At::Live).unwrap().len(), 1);
    assert_eq!((door.privacy("south").unwrap().zones.len(), bench.summary("south").privacy.zones), (0, 0));

    let feed = |id: &str, path: &Path| door.change_feed(id, &json!({"source": {"path": path}})).unwrap();
    let until = |id: &str, expected: bool| {
        wait_for(&format!("{id} to be hidden: {expected}"), || {
            (is_hidden(&bench, id) == expected).then_some(())
        });
    };
    feed("other", &own);
    assert_eq!(door.hidden("other", At::Live).unwrap().len(), 1, "before its first frame");
    until("other", true);
    feed("south", &other);
    assert!(door.hidden("south", At::Live).unwrap().is_empty());
    until("south", false);

    door.hold_privacy("north", Privacy::default()).unwrap();
    until("north", false);
    until("other", false);
    bench.stop();
}

#[test]
fn who_may_not_manage_all_that_show_the_same_hides_nothing_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let own = pictures(folder.path(), "north", 0..6);
    let other = pictures(folder.path(), "other", 0..6);
    let cameras = [("north", &own), ("south", &own), ("gate", &other)];
    let camera = cameras.map(|(id, path)| camera(id, path, End::Loop)).to_vec();
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[]);
    for id in ["north", "south", "gate"] {
        bench.wait_for_state(id, "live");
    }
    let held = || Privacy { zones: vec![garden()].into(), version: 1, ..Privacy::default() };
    let within = |cameras: &[(&str, &[Right])]| bench.handle.within(grants(Role::Operator, &[], cameras));
    let seeing: [Right; 3] = [Right::Live, Right::History, Right::Export];
    // Which cameras these are is not said, nor whether the caller knows of them.
    let told = |cameras: &[(&str, &[Right])]| {
        let operator = within(cameras);
        let checked = operator.check_privacy_change("north").unwrap_err();
        let refused = operator.hold_privacy("north", held()).unwrap_err();
        assert!(matches!(&checked, EngineError::Forbidden(_)) && checked.to_string() == refused.to_string());
        refused.to_string()
    };
    let refused = told(&[("north", &OFFER)]);
    assert_eq!(refused, "changing what is hidden of camera north is for admin and above");
    assert_eq!(told(&[("north", &OFFER), ("south", &seeing)]), refused);
    assert!(matches!(within(&[]).check_privacy_change("north"), Err(EngineError::NoCamera { .. })));
    for id in EACH {
        assert!(!is_hidden(&bench, id), "{id}");
        assert!(bench.handle.hidden(id, At::Live).unwrap().is_empty(), "{id}");
    }
    within(&[("gate", &OFFER)]).hold_privacy("gate", held()).unwrap();
    assert!(is_hidden(&bench, "gate"));
    // Managers of both do as an administrator, who is asked for no rights.
    within(&[("north", &OFFER), ("south", &OFFER)]).hold_privacy("north", held()).unwrap();
    assert!(EACH.iter().all(|id| is_hidden(&bench, id)));
    let lifted = within(&[("north", &OFFER)]).hold_privacy("north", Privacy::default());
    assert!(matches!(lifted, Err(EngineError::Forbidden(_))));
    assert_eq!(bench.handle.hidden("south", At::Live).unwrap().len(), 1);
    let admin = bench.handle.within(grants(Role::Admin, &[], &[]));
    admin.hold_privacy("north", Privacy::default()).unwrap();
    assert!(bench.handle.hidden("south", At::Live).unwrap().is_empty());
    bench.stop();
}

#[test]
fn zones_hold_for_what_lies_there_once_it_is_opened() {
    let folder = tempfile::tempdir().unwrap();
    let own = pictures(folder.path(), "own", 0..6);
    let later = folder.path().join("later");
    let cameras = [("north", later.join("in%04d.png")), ("south", own)];
    let camera = cameras.map(|(id, path)| camera(id, path, End::Loop)).to_vec();
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[]);
    let (door, hidden) = (&bench.handle, |id: &str| bench.handle.hidden(id, At::Live).unwrap().len());
    bench.wait_for_state("south", "live");
    bench.wait_for_state("north", "failed");
    let held = |zone: Zone| Privacy { zones: vec![zone].into(), version: 1, ..Privacy::default() };
    door.hold_privacy("south", held(garden())).unwrap();
    assert_eq!((hidden("north"), hidden("south")), (0, 1));
    door.hold_privacy("north", held(zone("top", &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.0, 0.3]]))).unwrap();
    assert_eq!((hidden("north"), hidden("south")), (1, 1), "nothing is there that both show");

    std::os::unix::fs::symlink(folder.path().join("own"), &later).unwrap();
    bench.wait_for_state("north", "live");
    assert_eq!((hidden("north"), hidden("south")), (2, 2), "each hides what the other hides");
    let first = door.observation("north", At::Time(Timestamp::from_nanos(0))).unwrap().frame.image;
    assert!(hides(&first, &garden()), "from the first frame on");
    bench.stop();
}
