//! The database's disk: full, failing, without its log, or with somebody else's.

use super::client::{Answer, Ask, ask, configure, demo_camera, demo_roots, end, limit, say};
use crate::daemon::process::{Daemon, start_command, videofields};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use videofields_recording::store::{Store, StoreError};
use videofields_testing::say_skipped;
use videofields_testing::small_disk::SmallDisk;
use videofields_vision::clock::Timestamp;

const YARD: &str = "/api/v1/scenes/yard";

/// A scene of a hundred boxes under that name.
fn scene(name: &str) -> String {
    let solid = |at: u32| json!({"id": format!("b{at}"), "center_m": [at * 3, 0, 1], "size_m": [2, 2, 2]});
    let boxes: Vec<Value> = (0..100).map(solid).collect();
    json!({"version": 1, "name": name, "boxes": boxes}).to_string()
}

/// Changes the yard, whatever it is; the answer.
fn put(daemon: &Daemon, name: &str) -> Answer {
    let now = ask(daemon.address, "GET", YARD, &Ask::default()).unwrap();
    let tag = now.field("etag").map(str::to_owned).filter(|_| now.status == 200);
    let condition = tag.as_deref().map_or(("if-none-match", "*"), |tag| ("if-match", tag));
    let request = Ask { fields: &[condition], body: &scene(name), ..Ask::default() };
    ask(daemon.address, "PUT", YARD, &request).unwrap()
}

fn name(daemon: &Daemon) -> String {
    daemon.json(YARD)["name"].as_str().unwrap().to_owned()
}

/// The number of the frame that a camera shows, which must be there.
fn frame(daemon: &Daemon) -> u64 {
    let shown = ask(daemon.address, "GET", "/api/v1/cameras/gate/frame.jpg", &Ask::default()).unwrap();
    assert_eq!(shown.status, 200, "{}", shown.text());
    shown.field("videofields-frame").unwrap().parse().unwrap()
}

/// Whatever else is, the camera is seen live and the probes answer.
fn it_shows_what_is_seen(daemon: &Daemon) {
    let first = frame(daemon);
    videofields_testing::wait_for("a newer frame", || (frame(daemon) != first).then_some(()));
    assert_eq!(daemon.get("/healthz").status, 200);
    assert_eq!(daemon.get("/metrics").status, 200);
}

/// Changes the yard until that is refused; the refusal, and the last name that was taken.
fn put_until_refused(daemon: &Daemon) -> (Answer, String) {
    let mut kept = name(daemon);
    for number in 0..2000 {
        let asked = format!("Yard {number}");
        let answer = put(daemon, &asked);
        if answer.status != 200 {
            return (answer, kept);
        }
        kept = asked;
    }
    panic!("every change was taken");
}

fn fill(place: &Path) -> PathBuf {
    let filler = place.join("filler");
    let filled = std::fs::write(&filler, vec![1; 64 << 20]);
    assert_eq!(filled.expect_err("no room").kind(), std::io::ErrorKind::StorageFull);
    filler
}

#[test]
fn on_a_full_disk_changes_are_507_and_all_else_goes_on() {
    let folder = TempDir::new().unwrap();
    let place = folder.path().join("disk");
    let Some(_disk) = SmallDisk::mount(&place, 24) else {
        return say_skipped("this process may not mount a small disk");
    };
    let rest = format!("{}{}", demo_roots(), demo_camera("gate"));
    let config = configure(folder.path(), &place.join("kept.sqlite"), &rest);
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&["gate"]);
    assert_eq!(put(&daemon, "Yard").status, 201);

    let filler = fill(&place);
    let (refused, kept) = put_until_refused(&daemon);
    assert_eq!(refused.status, 507, "{}", refused.text());
    assert_eq!(refused.json()["type"], "urn:videofields:problem:storage-full", "{}", refused.text());
    assert_eq!(name(&daemon), kept, "what was refused changed nothing");
    it_shows_what_is_seen(&daemon);

    // Nobody has to do anything but make room.
    std::fs::remove_file(&filler).unwrap();
    assert_eq!(put(&daemon, "Room again").status, 200);

    // It can be ended while the disk is full, and comes back with all that was acknowledged.
    let filler = fill(&place);
    let (_, kept) = put_until_refused(&daemon);
    let stopped = end(daemon);
    assert!(stopped.stderr.contains("full"), "{}", stopped.stderr);
    std::fs::remove_file(&filler).unwrap();
    let daemon = Daemon::start(&config);
    assert_eq!(name(&daemon), kept);
    assert_eq!(end(daemon).status, Some(0));
}

/// Past its limit on files' sizes the system fails every write of a process, as a disk does that breaks.
#[test]
fn on_a_disk_that_fails_changes_are_503_and_what_is_seen_is_shown() {
    let folder = TempDir::new().unwrap();
    let rest = format!("{}{}", demo_roots(), demo_camera("gate"));
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), &rest);
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' XFSZ; exec \"$0\" \"$@\""]).arg(videofields().get_program());
    command.env("VIDEOFIELDS_ACCURACY__MEASURE_AT_START", "false");
    let daemon = start_command(command, &config, &["--listen", "127.0.0.1:0"], "http://");
    daemon.wait_until_live(&["gate"]);
    assert_eq!(put(&daemon, "Yard").status, 201);

    limit(&daemon, "--fsize=1:unlimited");
    for _ in 0..8 {
        let refused = put(&daemon, "Lost");
        assert_eq!(refused.status, 503, "{}", refused.text());
        assert!(refused.json()["detail"].as_str().unwrap().contains("disk"), "{}", refused.text());
    }
    assert_eq!(name(&daemon), "Yard");
    it_shows_what_is_seen(&daemon);
    limit(&daemon, "--fsize=unlimited:unlimited");
    assert_eq!(put(&daemon, "Mended").status, 200);
    let stopped = end(daemon);
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    let daemon = Daemon::start(&config);
    assert_eq!(name(&daemon), "Mended");
    end(daemon);
}

async fn open(path: &Path) -> Store {
    Store::open(path).await.expect("a database")
}

async fn put_scenes(store: &Store, names: std::ops::Range<i64>) {
    for number in names {
        let mut text = String::new();
        write!(text, "\"{number} {}\"", "x".repeat(3000)).unwrap();
        let at = Timestamp::from_nanos(number);
        store.put_scene(&format!("scene-{number}"), &text, at).await.expect("written");
    }
}

#[tokio::test]
async fn without_its_log_a_database_is_as_it_was_when_the_log_was_last_put_into_it() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("kept.sqlite");
    let store = open(&path).await;
    put_scenes(&store, 0..20).await;
    store.close().await.expect("closed");
    let store = open(&path).await;
    put_scenes(&store, 20..40).await;
    // As a killed daemon leaves it, but that somebody deleted the log.
    let left = folder.path().join("left.sqlite");
    std::fs::copy(&path, &left).unwrap();
    store.close().await.expect("closed");
    let found = open(&left).await;
    assert_eq!(found.check_integrity().await.expect("checked"), Vec::<String>::new());
    let n_kept = found.scenes().await.expect("read").len();
    assert!((20..=40).contains(&n_kept), "{n_kept}: what was put into the file is there");
    put_scenes(&found, 40..60).await;
    assert_eq!(found.scenes().await.expect("read").len(), n_kept + 20);
    found.close().await.expect("closed");
}

/// Whoever puts a copy in a database's place and leaves the log of the one before mixes two databases.
#[tokio::test]
async fn a_copy_beside_the_log_of_another_database_is_refused_or_whole() {
    let folder = TempDir::new().unwrap();
    let (copy, other) = (folder.path().join("copy.sqlite"), folder.path().join("other.sqlite"));
    let store = open(&copy).await;
    put_scenes(&store, 0..30).await;
    store.close().await.expect("closed");
    let store = open(&other).await;
    put_scenes(&store, 0..5).await;
    store.close().await.expect("closed");
    let store = open(&other).await;
    put_scenes(&store, 100..160).await;
    std::fs::copy(other.with_extension("sqlite-wal"), copy.with_extension("sqlite-wal")).unwrap();
    store.close().await.expect("closed");
    match Store::open(&copy).await {
        Err(error) => {
            assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
            say(&error.to_string());
        }
        Ok(store) => {
            assert_eq!(store.check_integrity().await.expect("checked"), Vec::<String>::new());
            say("whole");
        }
    }
}
