//! The database as the daemon meets it: opened, reopened, damaged, fought over, and cut off.

mod copies;
mod history;
mod sealed;

use sha2::Digest;
use sqlx::{Connection, SqliteConnection};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use videofields_recording::store::{
    BackgroundRecord, MAX_BLOB_BYTES, SCHEMA_VERSION, Store, StoreError, TextureMapRecord, digest_hex,
};
use videofields_testing::small_disk::SmallDisk;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, ColorMatrix};

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

async fn open(path: &Path) -> Store {
    Store::open(path).await.expect("a database")
}

async fn refusal(path: &Path) -> StoreError {
    Store::open(path).await.expect_err("a refusal")
}

fn camera(id: &str) -> CameraId {
    CameraId::new(id).expect("an id")
}

fn at(nanos: i64) -> Timestamp {
    Timestamp::from_nanos(nanos)
}

fn background(id: &str, width: u32, saved_at: i64) -> BackgroundRecord {
    BackgroundRecord {
        camera: camera(id),
        saved_at: at(saved_at),
        width,
        height: 480,
        matrix: ColorMatrix::Bt709,
        version: 1,
        bytes: (0..100_000_u32).map(|i| (i * 7 + width) as u8).collect(),
    }
}

fn map(name: &str, scene: &str, bytes: usize) -> TextureMapRecord {
    TextureMapRecord {
        digest: sha2::Sha256::digest(name.as_bytes()).into(),
        scene: scene.to_owned(),
        camera: camera("north"),
        created_at: at(5),
        bytes: vec![7; bytes],
    }
}

/// Runs SQL on the file behind the store's back.
async fn tamper(path: &Path, sql: &str) {
    let mut connection =
        SqliteConnection::connect(&format!("sqlite://{}?mode=rwc", path.display())).await.expect("opened");
    sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut connection).await.expect("done");
    connection.close().await.expect("closed");
}

#[tokio::test]
async fn what_was_written_is_read_after_reopening() {
    let folder = folder();
    let path = folder.path().join("data/deep/videofields.sqlite");
    let store = open(&path).await;
    assert_eq!(store.path(), path);
    for file in [path.clone(), path.with_extension("sqlite-wal")] {
        let mode = std::fs::metadata(&file).expect("there").permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{}: only its owner reads what cameras saw", file.display());
    }
    let digest = store.put_scene("plaza", r#"{"version":1}"#, at(10)).await.expect("written");
    assert_eq!(digest, digest_hex(br#"{"version":1}"#));
    store.put_background(&background("north", 640, 3)).await.expect("written");
    store.put_texture_map(&map("a", "plaza", 10)).await.expect("written");
    store.close().await.expect("closed");
    assert!(!path.with_extension("sqlite-wal").try_exists().expect("looked"), "the log is in the file");

    let store = open(&path).await;
    let scene = store.scene("plaza").await.expect("read").expect("there");
    assert_eq!(
        (scene.document.as_str(), scene.updated_at, scene.digest),
        (r#"{"version":1}"#, at(10), digest)
    );
    let read = store.latest_background(&camera("north")).await.expect("read");
    assert_eq!(read, Some(background("north", 640, 3)));
    let read = store.texture_map(&map("a", "", 0).digest).await.expect("read");
    assert_eq!(read, Some(map("a", "plaza", 10)));
}

#[tokio::test]
async fn scenes_are_listed_changed_and_removed() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    assert_eq!(store.scene("plaza").await.expect("read"), None);
    assert_eq!(store.scenes().await.expect("read"), []);
    store.put_scene("plaza", "{}", at(1)).await.expect("written");
    store.put_scene("alley", "[]", at(2)).await.expect("written");
    store.put_scene("plaza", "{}", at(3)).await.expect("written");
    let times = |entries: &[videofields_recording::store::SceneEntry]| -> Vec<(String, i64)> {
        entries.iter().map(|entry| (entry.id.clone(), entry.updated_at.as_nanos())).collect()
    };
    let listed = store.scenes().await.expect("read");
    assert_eq!(
        times(&listed),
        [("alley".into(), 2), ("plaza".into(), 1)],
        "an equal document keeps its time"
    );
    store.put_scene("plaza", "[1]", at(4)).await.expect("written");
    assert_eq!(times(&store.scenes().await.expect("read"))[1], ("plaza".into(), 4));
    assert!(store.delete_scene("alley").await.expect("done"));
    assert!(!store.delete_scene("alley").await.expect("done"));
    let hostile = "x'; drop table scene; --";
    assert_eq!(store.scene(hostile).await.expect("read"), None);
    let error = store.put_scene("broken", "{", at(5)).await.expect_err("no JSON");
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert_eq!(store.scenes().await.expect("read").len(), 1);
}

#[tokio::test]
async fn a_camera_keeps_one_background_a_size() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    let north = camera("north");
    assert_eq!(store.latest_background(&north).await.expect("read"), None);
    for (width, saved_at) in [(320, 1), (640, 2), (640, 3), (100, 4), (101, 5)] {
        store.put_background(&background("north", width, saved_at)).await.expect("written");
    }
    store.put_background(&background("south", 640, 9)).await.expect("written");
    let read = |width| store.background(&north, width, 480);
    assert_eq!(store.latest_background(&north).await.expect("read"), Some(background("north", 101, 5)));
    assert_eq!(read(640).await.expect("read"), Some(background("north", 640, 3)));
    assert_eq!(read(320).await.expect("read"), Some(background("north", 320, 1)));
    // A fifth size lets the oldest of the others go, though its own time lies before theirs.
    store.put_background(&background("north", 102, 0)).await.expect("written");
    assert_eq!(read(320).await.expect("read"), None);
    assert_eq!(read(102).await.expect("read"), Some(background("north", 102, 0)));
    assert_eq!(
        store.latest_background(&camera("south")).await.expect("read"),
        Some(background("south", 640, 9))
    );
}

#[tokio::test]
async fn maps_that_were_used_longest_ago_go_first() {
    let folder = folder();
    let store =
        Store::open_with_texture_maps_bytes(&folder.path().join("a.sqlite"), 1000).await.expect("a database");
    for name in ["a", "b", "c"] {
        store.put_texture_map(&map(name, "plaza", 300)).await.expect("written");
    }
    let is_kept =
        async |name: &str| store.texture_map(&map(name, "", 0).digest).await.expect("read").is_some();
    assert!(is_kept("a").await, "and is now the latest used");
    store.put_texture_map(&map("d", "alley", 300)).await.expect("written");
    assert!(!is_kept("b").await, "b was used longest ago");
    assert!(is_kept("c").await && is_kept("a").await && is_kept("d").await);

    let error = store.put_texture_map(&map("e", "plaza", 1001)).await.expect_err("too large");
    assert_eq!(error.kind(), ErrorKind::TooLarge);
    assert!(error.to_string().contains("has 1001 bytes; at most 1000 are kept"), "{error}");

    let current = map("a", "", 0).digest;
    let removed = store.delete_stale_texture_maps("plaza", &camera("north"), &current).await.expect("done");
    assert_eq!(removed, 1);
    assert!(is_kept("a").await && !is_kept("c").await && is_kept("d").await, "the other scene's map stays");
}

#[tokio::test]
async fn what_sqlite_cannot_hold_is_refused_before_it_is_tried() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    // Zeroed memory is not touched until it is used, so this costs nothing.
    let large = BackgroundRecord { bytes: vec![0; MAX_BLOB_BYTES + 1], ..background("north", 640, 1) };
    let error = store.put_background(&large).await.expect_err("too large");
    assert_eq!(error.kind(), ErrorKind::TooLarge);
}

#[tokio::test]
async fn a_file_that_is_not_ours_is_refused_with_the_reason() {
    let folder = folder();
    let write = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    };
    let text = write("text.sqlite", b"these are my notes, not a database");
    assert!(refusal(&text).await.to_string().contains("not a SQLite database but another kind of file"));
    assert_eq!(std::fs::read(&text).expect("read"), b"these are my notes, not a database");
    assert!(refusal(folder.path()).await.to_string().contains("but a directory"));
    let mut fake = b"SQLite format 3\0".to_vec();
    fake.resize(4096, 0xa5);
    let error = refusal(&write("fake.sqlite", &fake)).await;
    assert!(matches!(error, StoreError::NotADatabase { .. } | StoreError::Damaged { .. }), "{error}");

    let foreign = folder.path().join("foreign.sqlite");
    tamper(&foreign, "create table t (x); insert into t values (1);").await;
    let before = std::fs::read(&foreign).expect("read");
    let error = refusal(&foreign).await;
    assert!(matches!(error, StoreError::Foreign { application_id: 0, .. }), "{error}");
    assert_eq!(error.kind(), ErrorKind::Invalid);
    assert_eq!(std::fs::read(&foreign).expect("read"), before, "another program's file is left alone");

    let empty = write("empty.sqlite", b"");
    assert!(open(&empty).await.scenes().await.expect("read").is_empty());
}

#[tokio::test]
async fn a_newer_schema_is_refused_and_left_alone() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    open(&path).await.close().await.expect("closed");
    tamper(
        &path,
        "insert into _sqlx_migrations (version, description, success, checksum, execution_time)
         values (9999, 'from the future', true, x'00', 0)",
    )
    .await;
    let error = refusal(&path).await;
    assert!(matches!(error, StoreError::NewerSchema { found: 9999, known: SCHEMA_VERSION, .. }), "{error}");
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    tamper(&path, "delete from _sqlx_migrations where version = 9999").await;
    open(&path).await;
}

#[tokio::test]
async fn an_edited_migration_is_noticed() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    open(&path).await.close().await.expect("closed");
    tamper(&path, "update _sqlx_migrations set checksum = x'00' where version = 2").await;
    let error = refusal(&path).await;
    assert!(matches!(error, StoreError::Migration { .. }), "{error}");
}

#[tokio::test]
async fn a_damaged_file_is_refused() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    for i in 0..200 {
        let document = format!("\"{}\"", "x".repeat(500));
        store.put_scene(&format!("scene-{i}"), &document, at(i)).await.expect("written");
    }
    store.close().await.expect("closed");
    let sound = std::fs::read(&path).expect("read");
    // Every page but the first is overwritten in turn: each time the file is refused or, where the page was
    // free, opened; never a panic.
    let mut refused = 0;
    let pages = sound.len() / 4096;
    for page in 1..pages {
        let mut bytes = sound.clone();
        bytes[page * 4096..(page + 1) * 4096].fill(0x5a);
        std::fs::write(&path, &bytes).expect("written");
        match Store::open(&path).await {
            Err(StoreError::Damaged { detail, .. }) => {
                assert!(!detail.is_empty());
                refused += 1;
            }
            Err(other) => panic!("{other}"),
            Ok(store) => store.close().await.expect("closed"),
        }
    }
    assert!(refused * 10 >= (pages - 1) * 9, "{refused} of {pages} pages were missed");
    std::fs::write(&path, &sound[..sound.len() / 2]).expect("written");
    let error = refusal(&path).await;
    assert!(matches!(error, StoreError::Damaged { .. }), "a file cut in half: {error}");
}

#[tokio::test]
async fn a_place_that_cannot_be_written_is_refused() {
    let folder = folder();
    let file = folder.path().join("file");
    std::fs::write(&file, b"x").expect("written");
    let error = refusal(&file.join("a.sqlite")).await;
    assert!(matches!(error, StoreError::NotWritable { .. }), "{error}");
    assert!(error.to_string().starts_with("cannot write the database: "), "{error}");
    // Nobody, root included, makes files here.
    let error = refusal(Path::new("/proc/self/a.sqlite")).await;
    assert!(matches!(error, StoreError::NotWritable { .. }), "{error}");
    assert_eq!(error.kind(), ErrorKind::Invalid);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn concurrent_writers_wait_for_one_another() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    // Two processes, as far as SQLite can tell, that open the fresh file at once.
    let (one, two) = tokio::join!(Store::open(&path), Store::open(&path));
    let stores = [one.expect("a database"), two.expect("a database")];
    let mut tasks = tokio::task::JoinSet::new();
    for writer in 0..8 {
        let store = stores[writer % 2].clone();
        tasks.spawn(async move {
            let id = format!("writer-{writer}");
            for turn in 0..25 {
                store.put_scene(&id, &turn.to_string(), at(turn)).await.expect("written");
                store.put_background(&background(&id, 640, turn)).await.expect("written");
                store.put_texture_map(&map(&format!("{id}{turn}"), "plaza", 1000)).await.expect("written");
                let scene = store.scene(&id).await.expect("read").expect("there");
                assert_eq!(scene.document, turn.to_string(), "what was acknowledged is read");
            }
        });
    }
    while let Some(done) = tasks.join_next().await {
        done.expect("no writer failed");
    }
    assert_eq!(stores[0].scenes().await.expect("read").len(), 8);
}

#[tokio::test]
async fn a_process_that_ends_at_any_moment_loses_nothing_acknowledged() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    for turn in 0..10 {
        store.put_scene("plaza", &turn.to_string(), at(turn)).await.expect("written");
        store.put_background(&background("north", 640, turn)).await.expect("written");
        // What a killed process leaves on the disk: the file and its log as they are now, nothing closed.
        let left = folder.path().join(format!("left-{turn}.sqlite"));
        std::fs::copy(&path, &left).expect("copied");
        std::fs::copy(path.with_extension("sqlite-wal"), left.with_extension("sqlite-wal")).expect("copied");
        let found = open(&left).await;
        assert_eq!(found.scene("plaza").await.expect("read").expect("there").document, turn.to_string());
        let read = found.latest_background(&camera("north")).await.expect("read");
        assert_eq!(read, Some(background("north", 640, turn)));
    }
    drop(store);
    assert_eq!(open(&path).await.scene("plaza").await.expect("read").expect("there").updated_at, at(9));
}

#[tokio::test]
async fn a_write_cut_short_leaves_the_one_before() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    store.put_background(&background("north", 640, 1)).await.expect("written");
    let whole = std::fs::read(path.with_extension("sqlite-wal")).expect("the log");
    store.put_background(&background("north", 640, 2)).await.expect("written");
    let log = std::fs::read(path.with_extension("sqlite-wal")).expect("the log");
    assert!(log.len() > whole.len());
    // A power cut in the middle of the second write: its log ends somewhere, or is torn there.
    for step in 1..8 {
        let end = whole.len() + (log.len() - whole.len()) * step / 8;
        let left = folder.path().join(format!("left-{step}.sqlite"));
        std::fs::copy(&path, &left).expect("copied");
        let mut torn = log[..end].to_vec();
        torn.resize(log.len(), 0);
        std::fs::write(left.with_extension("sqlite-wal"), &torn).expect("written");
        let read = open(&left).await.latest_background(&camera("north")).await.expect("read");
        assert_eq!(read, Some(background("north", 640, 1)), "cut after {end} bytes of the log");
    }
}

#[tokio::test]
async fn measured_costs_are_kept_for_each_machine_and_a_few_machines() {
    let folder = folder();
    let store = open(&folder.path().join("a.sqlite")).await;
    let machine = |number: i64| digest_hex(&number.to_le_bytes());
    assert_eq!(store.measured_cost(&machine(0)).await.expect("read"), None);
    for number in 0..10_i64 {
        let document = format!("{{\"rows\": {number}}}");
        store.put_measured_cost(&machine(number), &document, at(number)).await.expect("written");
    }
    let kept = async |number| store.measured_cost(&machine(number)).await.expect("read");
    assert_eq!((kept(0).await, kept(1).await), (None, None), "measured longest ago");
    assert_eq!(kept(2).await.as_deref(), Some("{\"rows\": 2}"));
    // A clock that stepped back does not lose what was just measured.
    store.put_measured_cost(&machine(0), "{}", at(-5)).await.expect("written");
    assert_eq!((kept(0).await.as_deref(), kept(2).await), (Some("{}"), None));
    assert!(store.put_measured_cost(&machine(0), "no json", at(9)).await.is_err());
    assert_eq!(kept(0).await.as_deref(), Some("{}"), "what was there stays");
}

/// Every connection that met the full disk is of use again.
#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_is_told_and_what_is_written_once_there_is_room_is_kept() {
    let folder = folder();
    let place = folder.path().join("disk");
    let Some(_disk) = SmallDisk::mount(&place, 4) else {
        videofields_testing::say_skipped("this process may not mount a small disk");
        return;
    };
    let store = open(&place.join("v.sqlite")).await;
    store.put_background(&background("north", 640, 1)).await.expect("written");
    let filler = place.join("filler");
    let filled = std::fs::write(&filler, vec![1; 8 << 20]);
    assert_eq!(filled.expect_err("no room").kind(), std::io::ErrorKind::StorageFull);
    let all = |saved_at: i64| {
        let turns = (0..8).map(|turn| {
            let store = store.clone();
            let record = background(&format!("camera{turn}"), 640, saved_at);
            tokio::spawn(async move { store.put_background(&record).await })
        });
        turns.collect::<Vec<_>>()
    };
    for turn in all(2) {
        let error = turn.await.expect("no panic").expect_err("the disk is full");
        assert!(error.to_string().contains("full"), "{error}");
    }
    std::fs::remove_file(&filler).expect("removed");
    for saved_at in 3..6 {
        for turn in all(saved_at) {
            turn.await.expect("no panic").expect("there is room again");
        }
    }
    let kept = store.background(&camera("camera7"), 640, 480).await;
    assert_eq!(kept.expect("read").map(|found| found.saved_at), Some(at(5)));
    store.close().await.expect("closed");
}
