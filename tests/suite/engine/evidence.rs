//! Snapshots kept as evidence, over a running engine: what is in them, that they are whole or not at all, and that what was
//! changed since shows.

use super::{Bench, FRAME_NANOS, SCENE, at, camera, has_adapter, pictures, request};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tempfile::TempDir;
use videofields_recording::signing::SigningKey;
use videofields_recording::store::{SnapshotRecord, SnapshotSearch, Store};
use videofields_recording::telemetry::Metrics;
use videofields_service::catalog::Condition;
use videofields_service::engine::At;
use videofields_service::evidence::{
    Annotated, EvidenceError, Maker, Schedule, Scheduled, SnapshotSettings, Snapshots, Subject, Wanted,
    check_archive, check_folder, check_index,
};
use videofields_testing::small_disk::SmallDisk;
use videofields_vision::access::{Grants, Rights, Role};
use videofields_vision::clock::{Clock, SimulatedClock, Timestamp};
use videofields_vision::config::{End, Settings};

const NOW: Timestamp = Timestamp::from_nanos(1_800_000_000_000_000_000);

/// Lifting of a hold where everybody is an admin, and ever was.
const ADMINS: (fn(&str) -> bool, Timestamp) = (|_user| true, Timestamp::from_nanos(i64::MIN));

/// Two cameras that have seen twenty frames each.
fn seen(folder: &Path) -> Bench {
    let cameras = ["north", "south"].map(|id| camera(id, pictures(folder, id, 0..20), End::Stop));
    let bench = Bench::start(
        folder,
        Settings { camera: cameras.to_vec(), ..Settings::default() },
        &[("yard", SCENE)],
    );
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    bench
}

/// Where snapshots lie with their index: `state/snapshots` and `state/index.sqlite`.
struct Vault {
    state: PathBuf,
    store: Store,
    clock: Arc<SimulatedClock>,
    metrics: Arc<Metrics>,
    snapshots: Snapshots,
}

fn settings(state: &Path) -> SnapshotSettings {
    SnapshotSettings {
        folder: state.join("snapshots"),
        max_bytes: 1 << 30,
        max_age_nanos: 1_000_000_000_000,
        min_free_bytes: 0,
        lift_window_nanos: None,
    }
}

impl Vault {
    async fn open(state: &Path) -> Self {
        Self::within(settings(state), state).await
    }

    async fn within(settings: SnapshotSettings, state: &Path) -> Self {
        std::fs::create_dir_all(state).unwrap();
        let store = Store::open(&state.join("index.sqlite")).await.unwrap();
        let (clock, metrics) = (Arc::new(SimulatedClock::new(NOW)), Arc::new(Metrics::new()));
        let snapshots =
            Snapshots::open(settings, store.clone(), Arc::clone(&metrics), Arc::clone(&clock) as _)
                .await
                .unwrap();
        Self { state: state.to_owned(), store, clock, metrics, snapshots }
    }

    fn with_probe(self, probe: impl Fn(&'static str) -> io::Result<()> + Send + Sync + 'static) -> Self {
        Self { snapshots: self.snapshots.with_probe(probe), ..self }
    }

    async fn make(&self, bench: &Bench, wanted: Wanted) -> Result<SnapshotRecord, EvidenceError> {
        let grants = Grants::everything();
        let maker = Maker { user: Some("ann"), schedule: None, grants: &grants };
        self.clock.advance(Duration::from_secs(1));
        self.snapshots.make(&bench.handle, maker, wanted).await
    }

    async fn all(&self) -> Vec<SnapshotRecord> {
        let grants = Grants::everything();
        let search = SnapshotSearch { limit: 1000, ..SnapshotSearch::default() };
        self.snapshots.of(None, &grants).search(search).await.unwrap()
    }

    fn place(&self, id: &str) -> PathBuf {
        self.state.join("snapshots").join(id)
    }

    /// Every fault of the folder, its chain and the index.
    async fn faults(&self) -> Vec<String> {
        let checked = check_folder(&self.state.join("snapshots")).unwrap();
        check_index(&self.store, checked).await.unwrap().faults
    }

    async fn close(self) {
        drop(self.snapshots);
        self.store.close().await.unwrap();
    }
}

fn of_camera(camera: &str, frame: i64) -> Wanted {
    let subject = Subject::Camera { camera: camera.to_owned(), at: at(FRAME_NANOS * frame) };
    Wanted {
        subject,
        note: "at the gate".to_owned(),
        tags: vec!["gate".to_owned()],
        hold: false,
        blur_people: None,
    }
}

#[test]
fn a_record_tells_nobody_where_a_camera_that_fails_is_read_from() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let north = camera("north", pictures(folder.path(), "north", 0..20), End::Stop);
    let south = camera("south", folder.path().join("hidden-name.webm"), End::Stop);
    let settings = Settings { camera: vec![north, south], ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);
    bench.wait_for_state("north", "ended");
    let reason = bench.wait_for_state("south", "failed").reason.unwrap();
    assert!(reason.contains("hidden-name"), "{reason}");
    bench.runtime.block_on(async {
        let vault = Vault::open(&folder.path().join("state")).await;
        let asked = Box::new(request("yard", at(FRAME_NANOS * 12)));
        let subject = Subject::View { request: asked, parameters: String::new() };
        let made = vault.make(&bench, Wanted { subject, ..of_camera("north", 0) }).await.unwrap();
        let record = std::fs::read_to_string(vault.place(&made.id).join("record.json")).unwrap();
        assert!(!record.contains("hidden-name"), "{record}");
        let told = json!("its file cannot be played; administrators see more");
        assert_eq!(serde_json::from_str::<Value>(&record).unwrap()["cameras"][1]["reason"], told);
        vault.close().await;
    });
    bench.stop();
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn pixels(path: &Path) -> Vec<u8> {
    image::load_from_memory(&std::fs::read(path).unwrap()).unwrap().into_rgb8().into_raw()
}

#[test]
fn a_snapshot_of_a_view_holds_what_was_shown_and_from_what() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    let asked = request("yard", at(FRAME_NANOS * 12));
    let shown = bench.view(asked.clone()).unwrap();
    bench.runtime.block_on(async {
        let vault = Vault::open(&folder.path().join("state")).await;
        let subject = Subject::View { request: Box::new(asked), parameters: "width=40&height=30".to_owned() };
        let wanted = Wanted {
            subject,
            note: "who is it?".to_owned(),
            tags: vec!["case 7".to_owned()],
            hold: true,
            blur_people: None,
        };
        let made = vault.make(&bench, wanted).await.unwrap();
        let place = vault.place(&made.id);
        assert_eq!(pixels(&place.join("picture.png")), shown.image.data, "the very pixels");
        for id in ["north", "south"] {
            let frame = bench.handle.observation(id, at(FRAME_NANOS * 12)).unwrap().frame;
            assert_eq!(pixels(&place.join(format!("camera-{id}.png"))), frame.image.to_rgb().data, "{id}");
        }
        let bytes = std::fs::read(place.join("record.json")).unwrap();
        let record: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(sha256(&bytes), made.digest.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
        for file in record["files"].as_array().unwrap() {
            let content = std::fs::read(place.join(file["file"].as_str().unwrap())).unwrap();
            assert_eq!(file["sha256"], json!(sha256(&content)));
            assert_eq!(file["bytes"], json!(content.len()));
        }
        assert_eq!(record["files"].as_array().unwrap().len(), 3);
        let time = Timestamp::from_nanos(FRAME_NANOS * 12).to_string();
        assert_eq!(
            (&record["time"], &record["kind"], &record["subject"]),
            (&json!(time), &json!("scene"), &json!("yard"))
        );
        assert_eq!(
            (&record["made_by"], &record["hold"], &record["tags"]),
            (&json!("ann"), &json!(true), &json!(["case 7"]))
        );
        assert_eq!(record["made_at"], json!(made.made_at.to_string()));
        assert_eq!(record["asked"]["parameters"], json!("width=40&height=30"));
        assert_eq!(record["view"]["eye_m"], json!([7, -7, 5]));
        assert_eq!(record["daemon"]["version"], json!(env!("CARGO_PKG_VERSION")));
        assert!(
            record["plan"]["effects"].as_array().unwrap().iter().any(|effect| effect["effect"] == "surface")
        );
        assert_eq!(record["scene"]["document"]["name"], json!("Yard"));
        let north = &record["cameras"][0];
        assert_eq!(
            (&north["id"], &north["part"], &north["state"]),
            (&json!("north"), &json!("frame"), &json!("ended"))
        );
        assert_eq!((&north["frame_time"], &north["frame_from"]), (&json!(time), &json!("memory")));
        assert_eq!(north["calibration"]["position_m"], json!([0, 8, 6]));
        let grants = Grants::everything();
        let reader = vault.snapshots.of(None, &grants);
        let found = reader.verify(&made.id).await.unwrap();
        assert!(found.is_whole && found.files.len() == 3, "{found:?}");
        assert_eq!(vault.faults().await, [""; 0]);
        // The next start finds it as it was.
        let (state, before) = (vault.state.clone(), vault.all().await);
        vault.close().await;
        let vault = Vault::open(&state).await;
        assert_eq!(vault.all().await, before);
        assert_eq!(vault.faults().await, [""; 0]);
    });
    bench.stop();
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &to);
        } else {
            std::fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// What is on the disk at every step is put aside, as a kill at that moment would leave it; then each is started again.
#[test]
fn a_kill_at_any_moment_leaves_a_snapshot_whole_or_not_at_all() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let state = folder.path().join("state");
        let taken: Arc<Mutex<Vec<(&'static str, PathBuf)>>> = Arc::default();
        let vault = Vault::open(&state).await;
        let first = vault.make(&bench, of_camera("north", 3)).await.unwrap();
        let vault = {
            let (state, taken, aside) = (state.clone(), Arc::clone(&taken), folder.path().join("aside"));
            vault.with_probe(move |step| {
                let mut taken = taken.lock().unwrap();
                let to = aside.join(taken.len().to_string());
                copy(&state, &to);
                taken.push((step, to));
                Ok(())
            })
        };
        let second = vault.make(&bench, of_camera("south", 5)).await.unwrap();
        let grants = Grants::everything();
        let condition = Condition::Version(1);
        vault.snapshots.of(Some("ann"), &grants).remove(&first.id, condition).await.unwrap();
        vault.close().await;
        let taken = std::mem::take(&mut *taken.lock().unwrap());
        let steps: Vec<&str> = taken.iter().map(|(step, _)| *step).collect();
        let expected = [
            "begun",
            "written",
            "complete",
            "renamed",
            "indexed",
            "unindexed",
            "marked",
            "removed",
            "removed",
        ];
        assert_eq!(steps, expected);
        for (place, (step, state)) in taken.into_iter().enumerate() {
            let vault = Vault::open(&state).await;
            let ids: Vec<String> = vault.all().await.into_iter().map(|record| record.id).collect();
            let expected: &[&String] = match place {
                0..3 => &[&first.id],
                // In the folder and not in the index: it is whole, and taken into it.
                3..5 => &[&second.id, &first.id],
                _ => &[&second.id],
            };
            assert_eq!(ids.iter().collect::<Vec<_>>(), expected, "{place}: {step}");
            assert_eq!(vault.faults().await, [""; 0], "{place}: {step}");
            let names =
                std::fs::read_dir(state.join("snapshots")).unwrap().map(|entry| entry.unwrap().file_name());
            assert!(
                names.into_iter().all(|name| !name.to_string_lossy().starts_with('.')),
                "{place}: {step}"
            );
            // And it goes on.
            let next = vault.make(&bench, of_camera("north", 7)).await.unwrap();
            assert_eq!(next.number, if place < 3 { 2 } else { 3 });
            assert_eq!(vault.faults().await, [""; 0], "{place}: {step}");
            vault.close().await;
        }
    });
    bench.stop();
}

#[test]
fn a_step_that_fails_leaves_nothing_and_the_next_snapshot_goes_on() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let failing: Arc<Mutex<Option<&'static str>>> = Arc::default();
        let told = Arc::clone(&failing);
        let vault = Vault::open(&folder.path().join("state")).await.with_probe(move |step| {
            let is_failing = *told.lock().unwrap() == Some(step);
            if is_failing { Err(io::ErrorKind::StorageFull.into()) } else { Ok(()) }
        });
        vault.make(&bench, of_camera("north", 1)).await.unwrap();
        for step in ["begun", "written", "complete"] {
            *failing.lock().unwrap() = Some(step);
            let failed = vault.make(&bench, of_camera("north", 2)).await;
            assert!(matches!(failed, Err(EvidenceError::Full(_))), "{step}: {failed:?}");
            let n = std::fs::read_dir(vault.state.join("snapshots")).unwrap().count();
            assert_eq!((n, vault.all().await.len()), (1, 1), "{step}");
        }
        *failing.lock().unwrap() = None;
        vault.make(&bench, of_camera("north", 3)).await.unwrap();
        assert_eq!(vault.faults().await, [""; 0]);
        let text = vault.metrics.encode();
        for line in [
            "videofields_evidence_snapshots_made_total 2",
            "videofields_evidence_failures_total{reason=\"no_room\"} 3",
            "videofields_evidence_kept_snapshots 2",
        ] {
            assert!(text.lines().any(|told| told == line), "{line}\n{text}");
        }
    });
    bench.stop();
}

#[test]
fn a_full_disk_refuses_snapshots_and_keeps_what_there_is() {
    let folder = TempDir::new().unwrap();
    let small = folder.path().join("small");
    let Some(_disk) = SmallDisk::mount(&small, 1) else {
        videofields_testing::say_skipped("no file system can be mounted here");
        return;
    };
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        // The index elsewhere: the folder alone is full.
        let state = folder.path().join("state");
        let vault =
            Vault::within(SnapshotSettings { folder: small.join("snapshots"), ..settings(&state) }, &state)
                .await;
        let made = vault.make(&bench, of_camera("north", 1)).await.unwrap();
        let mut filler = std::fs::File::create(small.join("filler")).unwrap();
        let zeros = vec![0; 4096];
        while io::Write::write_all(&mut filler, &zeros).is_ok() {}
        for _ in 0..3 {
            let failed = vault.make(&bench, of_camera("north", 2)).await;
            assert!(matches!(failed, Err(EvidenceError::Full(_))), "{failed:?}");
        }
        drop(filler);
        std::fs::remove_file(small.join("filler")).unwrap();
        vault.make(&bench, of_camera("north", 3)).await.unwrap();
        let checked = check_folder(&small.join("snapshots")).unwrap();
        let checked = check_index(&vault.store, checked).await.unwrap();
        assert_eq!((checked.n_there, checked.faults), (2, Vec::new()));
        assert!(vault.all().await.iter().any(|record| record.id == made.id));
        vault.close().await;
    });
    bench.stop();
}

#[test]
fn what_was_changed_exchanged_or_taken_out_shows() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let vault = Vault::open(&folder.path().join("state")).await;
        let mut made = Vec::new();
        for frame in 0..4 {
            made.push(vault.make(&bench, of_camera("north", frame)).await.unwrap());
        }
        let head = check_folder(&vault.state.join("snapshots")).unwrap().head;
        assert_eq!(head, Some(made[3].digest.iter().map(|byte| format!("{byte:02x}")).collect()));
        let whole = folder.path().join("whole");
        copy(&vault.state.join("snapshots"), &whole);
        let place = |idx: usize| vault.place(&made[idx].id);
        let restore = || {
            std::fs::remove_dir_all(vault.state.join("snapshots")).unwrap();
            copy(&whole, &vault.state.join("snapshots"));
        };
        let check = async |what: &str, idx: usize, part: &str| {
            let faults = vault.faults().await.join("\n");
            assert!(faults.contains(part), "{what}: {faults}");
            let grants = Grants::everything();
            let found = vault.snapshots.of(None, &grants).verify(&made[idx].id).await.unwrap();
            assert!(!found.is_whole && !found.faults.is_empty(), "{what}: {found:?}");
            restore();
            assert_eq!(vault.faults().await, [""; 0], "{what}");
        };
        let flip = |path: &Path| {
            let mut bytes = std::fs::read(path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            std::fs::write(path, bytes).unwrap();
        };
        flip(&place(1).join("picture.png"));
        check("a bit of the picture", 1, "picture.png: is not as it was sealed").await;
        let short = std::fs::read(place(1).join("picture.png")).unwrap();
        std::fs::write(place(1).join("picture.png"), &short[..short.len() - 1]).unwrap();
        check("a picture cut off", 1, "picture.png: is not as it was sealed").await;
        std::fs::remove_file(place(1).join("picture.png")).unwrap();
        check("no picture", 1, "picture.png: is missing").await;
        std::fs::write(place(1).join("extra.png"), b"x").unwrap();
        check("one more file", 1, "extra.png: is not in the record").await;
        let text = std::fs::read_to_string(place(1).join("record.json")).unwrap();
        std::fs::write(place(1).join("record.json"), text.replace("at the gate", "at the door")).unwrap();
        check("another note", 1, "record.json: is not the one that link.json was written for").await;
        // A record exchanged for that of another snapshot.
        for file in ["record.json", "picture.png"] {
            std::fs::copy(place(2).join(file), place(1).join(file)).unwrap();
        }
        check("exchanged", 1, &format!("is that of the snapshot {}", made[2].id)).await;
        // Whoever knows how rewrites record and link; the one behind it still names the old one.
        let text = text.replace("at the gate", "at the door");
        std::fs::write(place(1).join("record.json"), &text).unwrap();
        let link = std::fs::read_to_string(place(1).join("link.json")).unwrap();
        let old: String = made[1].digest.iter().map(|byte| format!("{byte:02x}")).collect();
        std::fs::write(place(1).join("link.json"), link.replace(&old, &sha256(text.as_bytes()))).unwrap();
        let faults = check_folder(&vault.state.join("snapshots")).unwrap().faults.join("\n");
        assert!(faults.contains(&format!("{}: is not chained to {}", made[2].id, made[1].id)), "{faults}");
        check("forged", 1, "is not the one that the index has").await;
        // Taken out.
        std::fs::remove_dir_all(place(2)).unwrap();
        let faults = check_folder(&vault.state.join("snapshots")).unwrap().faults.join("\n");
        assert!(faults.contains(&format!("{}: 1 snapshots before it are missing", made[3].id)), "{faults}");
        check("taken out", 2, "is missing from the folder").await;
        // Removed as it should be: the chain is whole, and says the same of its end.
        let grants = Grants::everything();
        let condition = Condition::Present;
        vault.snapshots.of(Some("ann"), &grants).remove(&made[2].id, condition).await.unwrap();
        let checked = check_folder(&vault.state.join("snapshots")).unwrap();
        assert_eq!((checked.n_there, checked.n_removed, &checked.head), (3, 1, &head));
        assert_eq!(vault.faults().await, [""; 0]);
        let left: Vec<_> =
            std::fs::read_dir(place(2)).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left.len(), 2, "{left:?}");
        // A database from before: what the folder has goes on where it ends.
    });
    bench.stop();
}

#[test]
fn a_folder_is_taken_into_an_index_that_was_put_back_from_a_copy() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let state = folder.path().join("state");
        let vault = Vault::open(&state).await;
        vault.make(&bench, of_camera("north", 1)).await.unwrap();
        vault.close().await;
        let copied = folder.path().join("index.sqlite");
        std::fs::copy(state.join("index.sqlite"), &copied).unwrap();
        let vault = Vault::open(&state).await;
        let second = vault.make(&bench, of_camera("north", 2)).await.unwrap();
        let third = Wanted { hold: true, ..of_camera("south", 3) };
        let third = vault.make(&bench, third).await.unwrap();
        let grants = Grants::everything();
        let condition = Condition::Present;
        vault.snapshots.of(None, &grants).remove(&second.id, condition).await.unwrap();
        let before = vault.all().await;
        vault.close().await;
        for copied_over in [Some(&copied), None] {
            match copied_over {
                Some(copied) => drop(std::fs::copy(copied, state.join("index.sqlite")).unwrap()),
                // No database at all.
                None => std::fs::remove_file(state.join("index.sqlite")).unwrap(),
            }
            let vault = Vault::open(&state).await;
            assert_eq!(vault.faults().await, [""; 0]);
            let found = vault.all().await;
            assert_eq!(found.len(), 2);
            assert_eq!(
                found.iter().map(|record| (&record.id, &record.digest, &record.cameras)).collect::<Vec<_>>(),
                before.iter().map(|record| (&record.id, &record.digest, &record.cameras)).collect::<Vec<_>>()
            );
            assert_eq!((&found[0].id, found[0].held_by.as_deref()), (&third.id, Some("ann")));
            vault.close().await;
        }
    });
    bench.stop();
}

#[test]
fn the_oldest_go_to_make_room_and_what_is_held_stays() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let state = folder.path().join("state");
        let vault = Vault::open(&state).await;
        let held = vault.make(&bench, Wanted { hold: true, ..of_camera("north", 0) }).await.unwrap();
        let one_bytes = held.n_bytes as u64;
        vault.close().await;
        // Room for three and a half.
        let max_bytes = one_bytes * 7 / 2;
        let vault = Vault::within(SnapshotSettings { max_bytes, ..settings(&state) }, &state).await;
        let mut made = Vec::new();
        for frame in 1..6 {
            made.push(vault.make(&bench, of_camera("north", frame)).await.unwrap().id);
        }
        let ids: Vec<String> = vault.all().await.into_iter().map(|record| record.id).collect();
        assert_eq!(ids, [&made[4], &made[3], &held.id].map(String::clone));
        // All are held: no room.
        let grants = Grants::everything();
        let reader = vault.snapshots.of(Some("ann"), &grants);
        let hold = Annotated { hold: Some(true), ..Default::default() };
        for id in &made[3..] {
            let condition = Condition::Version(1);
            reader.annotate(id, condition, hold.clone(), ADMINS).await.unwrap();
        }
        let failed = vault.make(&bench, of_camera("north", 7)).await;
        assert!(matches!(failed, Err(EvidenceError::Full(_))), "{failed:?}");
        let present = Condition::Present;
        assert!(matches!(reader.remove(&held.id, present).await, Err(EvidenceError::Held)));
        // Too old, and let go.
        let free = Annotated { hold: Some(false), ..Default::default() };
        reader.annotate(&made[3], present, free, ADMINS).await.unwrap();
        vault.clock.advance(Duration::from_secs(990));
        vault.snapshots.remove_old().await.unwrap();
        assert_eq!(vault.all().await.len(), 3);
        vault.clock.advance(Duration::from_secs(20));
        vault.snapshots.remove_old().await.unwrap();
        let ids: Vec<String> = vault.all().await.into_iter().map(|record| record.id).collect();
        assert_eq!(ids, [&made[4], &held.id].map(String::clone));
        assert_eq!(vault.faults().await, [""; 0]);
        assert_eq!(reader.annotations(&made[4]).await.unwrap().len(), 2);
        vault.close().await;
        // A disk with less room than is to be left.
        let vault =
            Vault::within(SnapshotSettings { min_free_bytes: u64::MAX, ..settings(&state) }, &state).await;
        let failed = vault.make(&bench, of_camera("north", 8)).await;
        assert!(matches!(failed, Err(EvidenceError::Full(_))), "{failed:?}");
    });
    bench.stop();
}

#[test]
fn a_request_to_lift_a_hold_ends_by_itself_and_takes_two_users() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let state = folder.path().join("state");
        let window = Some(60_000_000_000);
        let vault = Vault::within(SnapshotSettings { lift_window_nanos: window, ..settings(&state) }, &state);
        let vault = vault.await;
        let made = vault.make(&bench, Wanted { hold: true, ..of_camera("north", 0) }).await.unwrap();
        let grants = Grants::everything();
        let lift_since = async |user: Option<&str>, since: Timestamp| {
            let said = Annotated { hold: Some(false), ..Annotated::default() };
            let admins = (|_: &str| true, since);
            vault.snapshots.of(user, &grants).annotate(&made.id, Condition::Present, said, admins).await
        };
        let lift = async |user: Option<&str>| lift_since(user, Timestamp::from_nanos(i64::MIN)).await;
        let asked = async || vault.snapshots.of(None, &grants).one(&made.id).await.unwrap().lift;
        let refused = lift(None).await;
        assert!(
            matches!(&refused, Err(EvidenceError::Forbidden(why)) if why.contains("no users")),
            "{refused:?}"
        );
        assert!(lift(Some("ann")).await.unwrap().annotation.hold);
        vault.clock.advance(Duration::from_secs(59));
        assert_eq!(asked().await.unwrap().by, "ann");
        assert!(matches!(lift(Some("ann")).await, Err(EvidenceError::AskedAlready { .. })));
        vault.clock.advance(Duration::from_secs(1));
        assert_eq!(asked().await, None);
        // The second came too late, and is the first of another.
        assert!(lift(Some("bob")).await.unwrap().annotation.hold);
        assert_eq!(asked().await.unwrap().by, "bob");
        // An admin who was made after that, or whose token was, could be the first one's own.
        let asked_at = vault.clock.now();
        vault.clock.advance(Duration::from_secs(1));
        for since in [asked_at, asked_at.saturating_add_nanos(1), vault.clock.now()] {
            let refused = lift_since(Some("ann"), since).await;
            assert!(
                matches!(&refused, Err(EvidenceError::Forbidden(why)) if why.contains("older")),
                "{refused:?}"
            );
        }
        // Something else that is said meanwhile makes the request no younger.
        let note = Annotated { note: Some("soon".to_owned()), ..Annotated::default() };
        vault.snapshots.of(None, &grants).annotate(&made.id, Condition::Present, note, ADMINS).await.unwrap();
        assert!(lift_since(Some("ann"), asked_at.saturating_add_nanos(1)).await.is_err());
        let lifted = lift_since(Some("ann"), asked_at.saturating_add_nanos(-1)).await.unwrap();
        assert_eq!((lifted.annotation.hold, lifted.held_by, lifted.lift), (false, None, None));
        let said = vault.snapshots.of(None, &grants).annotations(&made.id).await.unwrap();
        let asking: Vec<bool> = said.iter().map(|said| said.asks_lift).collect();
        assert_eq!(asking, [false, true, true, false, false]);
    });
    bench.stop();
}

#[test]
fn each_operator_says_as_much_of_a_snapshot_as_is_kept_and_keeps_nobody_else_from_it() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let vault = Vault::open(&folder.path().join("state")).await;
        let made = vault.make(&bench, of_camera("north", 0)).await.unwrap();
        let operator = Grants::new(Role::Operator, Rights::ALL, [].into());
        let say = async |user: &str, grants: &Grants, said: Annotated| {
            vault.snapshots.of(Some(user), grants).annotate(&made.id, Condition::Present, said, ADMINS).await
        };
        let note = || Annotated { note: Some("x".repeat(2000)), ..Annotated::default() };
        for _ in 0..200 {
            say("eve", &operator, note()).await.unwrap();
        }
        assert!(matches!(say("eve", &operator, note()).await, Err(EvidenceError::Full(_))));
        let hold = Annotated { hold: Some(true), ..Annotated::default() };
        assert!(say("ann", &operator, hold).await.unwrap().annotation.hold);
        assert_eq!(say("eve", &Grants::everything(), note()).await.unwrap().annotation.version, 203);
    });
    bench.stop();
}

#[test]
fn the_daemons_own_leave_half_to_users_and_nobodys_push_out_anothers() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let state = folder.path().join("state");
        let vault = Vault::open(&state).await;
        let one_bytes = vault.make(&bench, of_camera("north", 0)).await.unwrap().n_bytes as u64;
        vault.close().await;
        let max_bytes = one_bytes * 19 / 2;
        let vault = Vault::within(SnapshotSettings { max_bytes, ..settings(&state) }, &state).await;
        let operator = Grants::new(Role::Operator, Rights::ALL, [].into());
        let everything = Grants::everything();
        let make = async |user: Option<&str>, schedule: Option<&str>, grants: &Grants| {
            vault.clock.advance(Duration::from_secs(1));
            let wanted = Wanted { note: String::new(), tags: Vec::new(), ..of_camera("north", 1) };
            vault.snapshots.make(&bench.handle, Maker { user, schedule, grants }, wanted).await
        };
        let kept = async |user: Option<&str>| {
            vault.all().await.iter().filter(|of| of.made_by.as_deref() == user).count()
        };
        for _ in 0..10 {
            make(None, Some("hourly"), &everything).await.unwrap();
        }
        assert_eq!((kept(Some("ann")).await, kept(None).await), (1, 4));
        // One who was there before there were users is nobody.
        make(None, None, &everything).await.unwrap();
        for _ in 0..10 {
            make(Some("eve"), None, &operator).await.unwrap();
        }
        assert_eq!((kept(Some("ann")).await, kept(None).await, kept(Some("eve")).await), (1, 5, 2));
        // One more, and it is full: Ann's alone make room for Ann's.
        for _ in 0..3 {
            make(Some("ann"), None, &everything).await.unwrap();
        }
        assert_eq!((kept(Some("ann")).await, kept(None).await, kept(Some("eve")).await), (2, 5, 2));
        assert!(matches!(make(Some("bob"), None, &everything).await, Err(EvidenceError::Full(_))));
        assert_eq!(vault.all().await.len(), 9);
        assert_eq!(vault.faults().await, [""; 0]);
        // A removal that nobody asked for stands in the audit log, with whose making made it go.
        vault.clock.advance(Duration::from_secs(1001));
        vault.snapshots.remove_old().await.unwrap();
        let log = vault.store.audit(0, 1000).await.unwrap();
        let count = |user: Option<&str>, action: &str| {
            log.iter()
                .filter(|line| line.entry.user.as_deref() == user && line.entry.action == action)
                .count()
        };
        let room = "snapshot removed to make room";
        assert_eq!((count(None, room), count(Some("eve"), room), count(Some("ann"), room)), (6, 8, 2));
        assert_eq!(count(None, "snapshot removed for its age"), 9);
    });
    bench.stop();
}

#[test]
fn an_archive_is_verified_elsewhere_and_shows_what_was_changed() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        use futures_util::TryStreamExt;
        let vault = Vault::open(&folder.path().join("state")).await;
        let made = vault.make(&bench, of_camera("south", 4)).await.unwrap();
        let digest: String = made.digest.iter().map(|byte| format!("{byte:02x}")).collect();
        let grants = Grants::everything();
        let bundle = vault.snapshots.of(None, &grants).bundle(&made.id).await.unwrap();
        let len_bytes = bundle.len_bytes();
        let pieces: Vec<Vec<u8>> = bundle.into_stream().try_collect().await.unwrap();
        let tar = pieces.concat();
        assert_eq!(tar.len() as u64, len_bytes);
        let found = check_archive(&tar[..], Some(&digest)).unwrap();
        assert!(found.is_whole && found.digest.as_ref() == Some(&digest), "{found:?}");
        assert!(!check_archive(&tar[..], Some(&"0".repeat(64))).unwrap().is_whole);
        // With the tools that everybody has, as its own text says.
        let path = folder.path().join("snapshot.tar");
        std::fs::write(&path, &tar).unwrap();
        let run = |program: &str, arguments: &[&str], place: &Path| {
            let done =
                std::process::Command::new(program).args(arguments).current_dir(place).output().unwrap();
            assert!(done.status.success(), "{program}: {}", String::from_utf8_lossy(&done.stderr));
            String::from_utf8(done.stdout).unwrap()
        };
        run("tar", &["-xf", "snapshot.tar"], folder.path());
        let inside = folder.path().join(format!("videofields-snapshot-{}", made.id));
        let lines = run("sha256sum", &["--check", "--strict", "SHA256SUMS"], &inside);
        assert_eq!(lines.lines().filter(|line| line.ends_with(": OK")).count(), 3, "{lines}");
        assert!(run("sha256sum", &["record.json"], &inside).starts_with(&digest));
        assert!(std::fs::read_to_string(inside.join("README.txt")).unwrap().contains(&digest));
        // Any byte of any file.
        let mut n_seen = 0;
        for place in (0..tar.len()).step_by(97) {
            let mut changed = tar.clone();
            changed[place] ^= 0x10;
            let is_whole = check_archive(&changed[..], Some(&digest)).is_ok_and(|found| found.is_whole);
            n_seen += usize::from(!is_whole);
        }
        let n_all = tar.len().div_ceil(97);
        // What is left: the text for people, zeros between files, owners and times in headers.
        assert!(n_seen * 2 > n_all, "{n_seen} of {n_all}");
        let cut = &tar[..tar.len() / 2];
        assert!(!check_archive(cut, None).is_ok_and(|found| found.is_whole));
        assert!(!check_archive(&b""[..], None).is_ok_and(|found| found.is_whole));
        // A picture exchanged along with its line in the list.
        let picture = std::fs::read(inside.join("picture.png")).unwrap();
        let mut other = picture.clone();
        *other.last_mut().unwrap() ^= 1;
        std::fs::write(inside.join("picture.png"), &other).unwrap();
        let sums = std::fs::read_to_string(inside.join("SHA256SUMS")).unwrap();
        std::fs::write(inside.join("SHA256SUMS"), sums.replace(&sha256(&picture), &sha256(&other))).unwrap();
        let inside_name = inside.file_name().unwrap().to_str().unwrap().to_owned();
        run("tar", &["-cf", "forged.tar", "--format=ustar", &inside_name], folder.path());
        let forged = std::fs::read(folder.path().join("forged.tar")).unwrap();
        let forged = check_archive(&forged[..], None).unwrap();
        assert!(forged.faults.iter().any(|fault| fault.starts_with("picture.png")), "{forged:?}");
    });
    bench.stop();
}

#[test]
fn snapshots_are_made_when_they_fall_due_and_failures_are_counted() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    bench.runtime.block_on(async {
        let vault = Vault::open(&folder.path().join("state")).await;
        let scheduled = |id: &str, camera: &str, period_secs: i64| {
            let subject = Subject::Camera { camera: camera.to_owned(), at: At::Live };
            let wanted = Wanted {
                subject,
                note: format!("by {id}"),
                tags: Vec::new(),
                hold: false,
                blur_people: None,
            };
            Scheduled { id: id.to_owned(), period_nanos: period_secs * 1_000_000_000, wanted }
        };
        let all = vec![scheduled("quarter", "north", 900), scheduled("gone", "nobody", 600)];
        let mut schedule = Schedule::new(all, NOW);
        let mut now = NOW;
        let mut made = Vec::new();
        for _ in 0..60 {
            now = now.saturating_add_nanos(60_000_000_000);
            vault.clock.advance(Duration::from_secs(60));
            made.extend(schedule.make_due(&vault.snapshots, &bench.handle, now).await);
        }
        let of = |id: &str| {
            made.iter().filter(|(name, _)| name == id).map(|(_, made)| made.is_ok()).collect::<Vec<_>>()
        };
        assert_eq!((of("quarter"), of("gone")), (vec![true; 4], vec![false; 6]));
        let counted = "videofields_evidence_failures_total{reason=\"no_picture\"} 6";
        assert!(vault.metrics.encode().lines().any(|line| line == counted), "{}", vault.metrics.encode());
        let kept = vault.all().await;
        assert_eq!(kept.len(), 4);
        assert!(
            kept.iter()
                .all(|record| record.schedule.as_deref() == Some("quarter") && record.made_by.is_none())
        );
        assert_eq!(vault.faults().await, [""; 0]);
    });
    bench.stop();
}

#[test]
fn a_signed_snapshot_is_nobody_elses() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path());
    let key = folder.path().join("key");
    let public = SigningKey::make(&key).unwrap().to_string();
    bench.runtime.block_on(async {
        use futures_util::TryStreamExt;
        let mut vault = Vault::open(&folder.path().join("state")).await;
        let unsigned = vault.make(&bench, of_camera("south", 3)).await.unwrap();
        let key = Arc::new(SigningKey::read(&key).unwrap());
        vault.snapshots = vault.snapshots.signed_with(Some(key));
        let made = vault.make(&bench, of_camera("south", 4)).await.unwrap();
        assert_eq!(vault.faults().await, Vec::<String>::new());
        let checked = check_folder(&vault.state.join("snapshots")).unwrap();
        assert_eq!(checked.signers, [(unsigned.id, None), (made.id.clone(), Some(public.clone()))]);
        let grants = Grants::everything();
        let reader = vault.snapshots.of(None, &grants);
        assert_eq!(reader.verify(&made.id).await.unwrap().signed_by, Some(public.clone()));
        let bundle = reader.bundle(&made.id).await.unwrap();
        let len_bytes = bundle.len_bytes();
        let tar = bundle.into_stream().try_collect::<Vec<_>>().await.unwrap().concat();
        assert_eq!(tar.len() as u64, len_bytes);
        let found = check_archive(&tar[..], None).unwrap();
        assert_eq!((found.signed_by, found.faults), (Some(public), vec![]));
        // With a record that was written anew, and its link and digest with it, the signature is another's.
        let place = vault.place(&made.id);
        let record = std::fs::read_to_string(place.join("record.json")).unwrap();
        std::fs::write(place.join("record.json"), record.replace("\"note\":\"", "\"note\":\"forged"))
            .unwrap();
        let faults = vault.faults().await.join("\n");
        assert!(faults.contains("signature.json: is not the signature of record.json"), "{faults}");
        std::fs::write(place.join("record.json"), record).unwrap();
        std::fs::write(place.join("signature.json"), "{}").unwrap();
        assert!(vault.faults().await.join("\n").contains("signature.json: is no signature"));
        vault.close().await;
    });
    bench.stop();
}
