//! Clips of what was recorded: the right frames with their times, and what their manifest says.

use super::super::Archive;
use super::super::tests::{OPEN_GROUPS, SECOND, Stage, at, decoded, frames, north};
use super::*;
use crate::media::{Input, Times};
use crate::share::GREED;
use crate::signing::SigningKey;
use crate::store::AuditEntry;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

const START: i64 = 500 * SECOND;

fn request(from: i64, to: i64) -> ExportRequest {
    let calibrations = BTreeMap::from([("plaza".to_owned(), serde_json::json!({"focal_px": [1, 2]}))]);
    let camera = ExportCamera {
        id: north(),
        name: "North".to_owned(),
        clock: serde_json::json!({}),
        calibrations,
        redrawing: None,
    };
    ExportRequest {
        cameras: vec![camera],
        from: at(from),
        to: at(to),
        note: "asked by\nnobody".to_owned(),
        asked_by: Some("ann".to_owned()),
        bound: Bound::All,
    }
}

/// Asks as soon as that can be done.
async fn ask(archive: &Archive, request: &ExportRequest) -> ExportStatus {
    for _ in 0..500 {
        if let Some(status) = archive.export(request.clone()).unwrap() {
            return status;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("the archive takes no exports");
}

/// The export once it came to its end.
async fn ended(archive: &Archive, id: &str) -> ExportStatus {
    for _ in 0..2000 {
        let status = archive.exports().one(id).unwrap();
        if matches!(status.state, ExportState::Done | ExportState::Failed) {
            return status;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("the export does not end");
}

async fn exported(archive: &Archive, request: &ExportRequest) -> ExportStatus {
    let asked = ask(archive, request).await;
    ended(archive, &asked.id).await
}

fn manifest_of(archive: &Archive, id: &str) -> Manifest {
    let (file, _) = archive.exports().open(id, "manifest.json").unwrap().unwrap();
    serde_json::from_reader(file).unwrap()
}

/// What a file of an export shows: times within it and sums of luma.
fn shown(archive: &Archive, id: &str, file: &str) -> Vec<(i64, u64)> {
    let (file, _) = archive.exports().open(id, file).unwrap().unwrap();
    decoded(Input::file(Path::new(&format!("/proc/self/fd/{}", file.as_raw_fd()))).unwrap(), Times::Played)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_clip_has_the_frames_of_its_span_across_files_to_the_bit_and_the_tick() {
    for (encoder, extension) in [
        ("x264enc bframes=2 key-int-max=10 tune=0", "mp4"),
        ("x264enc tune=zerolatency key-int-max=10", "mp4"),
        ("jpegenc", "mkv"),
        ("vp8enc deadline=1 keyframe-max-dist=10", "mkv"),
    ] {
        let stage = Stage::new().await;
        let original = frames(encoder, 110);
        stage.record(START, &original).await;
        let archive = stage.archive().await;
        let whole = archive.open_at(&north(), at(START)).await.unwrap().unwrap();
        let recorded = decoded(Input::stream(whole), Times::Written);

        let asked = request(START + SECOND * 5 / 4, START + SECOND * 26 / 5);
        let status = exported(&archive, &asked).await;
        assert_eq!((status.state, status.reason), (ExportState::Done, None), "{encoder}");
        let manifest = manifest_of(&archive, &status.id);
        let [camera] = manifest.cameras.as_slice() else { panic!("{manifest:?}") };
        let [clip] = camera.clips.as_slice() else { panic!("{encoder}: {manifest:#?}") };
        assert!(clip.file.ends_with(extension), "{encoder}: {}", clip.file);
        // Every JPEG is a key frame; of the others every tenth is.
        let first = if encoder == "jpegenc" { 25 } else { 20 };
        assert_eq!(clip.first_at, at(START + first * SECOND / 20).to_string(), "{encoder}");
        // Pictures of the span may build on one or two behind its end.
        let last: Timestamp = clip.last_at.parse().unwrap();
        assert!((103..=105).contains(&(last.nanos_since(at(START)) * 20 / SECOND)), "{encoder}: {last}");
        assert_eq!((clip.size_px, clip.recorded_in.len(), camera.gaps.len()), (Some([160, 120]), 2, 0));
        let seen = shown(&archive, &status.id, &clip.file);
        assert_eq!(seen.len() as u64, clip.frames, "{encoder}: {seen:?}");
        let n = (104 - first) as usize;
        let times: Vec<_> = seen.iter().map(|(nanos, _)| *nanos).take(n).collect();
        assert_eq!(times, (0..104 - first).map(|i| i * SECOND / 20).collect::<Vec<_>>(), "{encoder}");
        let sums = |of: &[(i64, u64)]| of.iter().map(|(_, sum)| *sum).collect::<Vec<_>>();
        let first = first as usize;
        assert_eq!(sums(&seen[..100 - first]), sums(&recorded[first..]), "{encoder}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_clip_of_open_groups_begins_with_its_key_frame_and_loses_nothing_behind_it() {
    let stage = Stage::new().await;
    stage.record(START, &frames(OPEN_GROUPS, 60)).await;
    let archive = stage.archive().await;
    let whole = archive.open_at(&north(), at(START)).await.unwrap().unwrap();
    let recorded = decoded(Input::stream(whole), Times::Written);
    let status = exported(&archive, &request(START + SECOND * 5 / 4, START + 2 * SECOND)).await;
    let manifest = manifest_of(&archive, &status.id);
    let clip = &manifest.cameras[0].clips[0];
    assert_eq!(
        (clip.first_at.clone(), clip.codec.as_str()),
        (at(START + SECOND).to_string(), "video/x-h265")
    );
    let seen = shown(&archive, &status.id, &clip.file);
    let expected: Vec<_> = recorded[20..40].iter().map(|(nanos, sum)| (nanos - SECOND, *sum)).collect();
    assert_eq!(seen[..20], expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_manifest_says_what_the_files_are_and_where_nothing_is() {
    let stage = Stage::new().await;
    stage.record(START, &frames("jpegenc", 40)).await;
    stage.record(START + 12 * SECOND, &frames("x264enc tune=zerolatency key-int-max=10", 40)).await;
    let archive = stage.archive().await;
    let asked = request(START - 5 * SECOND, START + 20 * SECOND);
    let status = exported(&archive, &asked).await;
    let manifest = manifest_of(&archive, &status.id);
    let camera = &manifest.cameras[0];
    let text = |nanos: i64| at(nanos).to_string();
    assert_eq!((manifest.version, &manifest.id, manifest.note.as_str()), (1, &status.id, "asked by\nnobody"));
    assert_eq!((manifest.asked_by.as_deref(), status.asked_by.as_deref()), (Some("ann"), Some("ann")));
    assert_eq!((&manifest.from, &manifest.to), (&text(START - 5 * SECOND), &text(START + 20 * SECOND)));
    assert_eq!(
        (camera.name.as_str(), camera.calibrations["plaza"]["focal_px"][1].as_i64()),
        ("North", Some(2))
    );
    let codecs: Vec<_> = camera.clips.iter().map(|clip| clip.codec.as_str()).collect();
    assert_eq!(codecs, ["image/jpeg", "video/x-h264"]);
    let ends = [START + 39 * SECOND / 20, START + 12 * SECOND + 39 * SECOND / 20];
    let expected = [
        [text(START - 5 * SECOND), text(START)],
        [text(ends[0]), text(START + 12 * SECOND)],
        [text(ends[1]), text(START + 20 * SECOND)],
    ];
    assert_eq!(camera.gaps, expected);
    assert_eq!(status.files.len(), 3);
    for file in &status.files {
        let (mut opened, _) = archive.exports().open(&status.id, &file.file).unwrap().unwrap();
        let mut bytes = Vec::new();
        opened.read_to_end(&mut bytes).unwrap();
        let hash: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!((file.bytes, &file.sha256), (bytes.len() as u64, &hash), "{}", file.file);
    }
    assert_eq!(status.bytes, status.files.iter().map(|file| file.bytes).sum::<u64>());
    assert_eq!(status.progress, 1.0);
    assert!(archive.exports().open(&status.id, "../../a.sqlite").unwrap().is_none());
}

#[tokio::test(flavor = "multi_thread")]
async fn exports_outlive_the_daemon_and_go_when_they_are_told_to_or_old() {
    let stage = Stage::new().await;
    stage.record(START, &frames("jpegenc", 40)).await;
    let archive = stage.archive().await;
    let first = exported(&archive, &request(START, START + SECOND)).await;
    let second = exported(&archive, &request(START, START + 2 * SECOND)).await;
    assert_ne!(first.id, second.id);
    archive.stop();
    drop(archive);
    let folder = stage.settings.folder.join("exported.clips");
    // Broken off in the midst, and what is not ours.
    std::fs::create_dir(folder.join("20200101t000000z")).unwrap();
    std::fs::write(folder.join("20200101t000000z/north.mp4"), b"half").unwrap();
    std::fs::create_dir(folder.join("case7")).unwrap();
    // One whose manifest would have files of elsewhere shown.
    let bad = folder.join(&second.id).join("manifest.json");
    let text = std::fs::read_to_string(&bad).unwrap();
    let evil = folder.join("20200101t000001z");
    std::fs::create_dir(&evil).unwrap();
    let text = text.replace(&second.id, "20200101t000001z").replace("north-1970", "../../north-1970");
    std::fs::write(evil.join("manifest.json"), text).unwrap();

    let archive = stage.archive().await;
    let third = exported(&archive, &request(START, START + SECOND)).await;
    assert_eq!(archive.exports().list(), [first.clone(), second.clone(), third.clone()]);
    assert!(!folder.join("20200101t000000z").is_dir() && folder.join("case7").is_dir());
    assert!(evil.is_dir(), "it is left as it is, and told of to nobody");
    assert!(archive.remove_export(&first.id).unwrap() && !archive.remove_export(&first.id).unwrap());
    assert!(!folder.join(&first.id).is_dir() && folder.join(&second.id).is_dir());
    assert_eq!(archive.exports().one(&first.id), None);
    stage.clock.advance(Duration::from_secs(8 * 86_400));
    for _ in 0..500 {
        if archive.exports().list().is_empty() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(archive.exports().list(), []);
    assert!(!folder.join(&third.id).is_dir());
}

#[tokio::test(flavor = "multi_thread")]
async fn exports_of_one_user_push_out_none_of_anothers() {
    let mut stage = Stage::new().await;
    stage.record(START, &frames("jpegenc", 40)).await;
    let archive = stage.archive().await;
    let of = |user: &str, bound: Bound| ExportRequest {
        asked_by: Some(user.to_owned()),
        bound,
        ..request(START, START + 2 * SECOND)
    };
    let first = exported(&archive, &of("ann", Bound::All)).await;
    archive.stop();
    drop(archive);
    // Room for six and a half.
    stage.settings.export_gib = first.bytes as f64 * 6.5 / f64::from(1 << 30);
    let archive = stage.archive().await;
    let kept = |user: &str| {
        let all = archive.exports().list();
        let done = all.iter().filter(|status| status.state == ExportState::Done);
        done.filter(|status| status.asked_by.as_deref() == Some(user)).count()
    };
    // Ids begin with the second, and one that is free again may be given anew.
    let later = || stage.clock.advance(Duration::from_secs(1));
    for _ in 0..10 {
        later();
        let status = exported(&archive, &of("eve", Bound::Free(GREED))).await;
        assert_eq!(status.state, ExportState::Done, "{status:?}");
    }
    assert_eq!((kept("ann"), kept("eve")), (1, 4));
    // Another finds room, and nobody's but one's own goes once there is none.
    for _ in 0..3 {
        later();
        assert_eq!(exported(&archive, &of("ann", Bound::All)).await.state, ExportState::Done);
    }
    assert_eq!((kept("ann"), kept("eve")), (2, 4));
    assert_eq!(archive.exports().one(&first.id), None);
    let refused = exported(&archive, &of("bob", Bound::All)).await;
    assert_eq!(refused.state, ExportState::Failed, "{refused:?}");
    assert!(refused.reason.is_some_and(|reason| reason.starts_with("your exports have no room left")));
    assert_eq!((kept("ann"), kept("eve")), (2, 4));
    let log = stage.store.audit(0, 1000).await.unwrap();
    let count = |user: &str| {
        let room = |entry: &AuditEntry| entry.action == "export removed to make room";
        log.iter().filter(|line| line.entry.user.as_deref() == Some(user) && room(&line.entry)).count()
    };
    assert_eq!((count("eve"), count("ann")), (6, 2));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_fit_or_was_never_recorded_comes_to_nothing_and_leaves_nothing() {
    let mut stage = Stage::new().await;
    stage.settings.export_gib = 0.000_01;
    stage.record(START, &frames("jpegenc", 100)).await;
    let archive = stage.archive().await;
    let check = async |from: i64, to: i64, expected: &str| {
        let status = exported(&archive, &request(from, to)).await;
        assert_eq!(status.state, ExportState::Failed);
        assert!(status.reason.as_deref().is_some_and(|reason| reason.starts_with(expected)), "{status:?}");
        assert!(!stage.settings.folder.join("exported.clips").join(&status.id).is_dir());
    };
    check(START, START + 5 * SECOND, "archive.export_gib is less than what is to be written: ").await;
    check(START + 10 * SECOND, START + 20 * SECOND, "nothing of it is recorded").await;
    check(START - 20 * SECOND, START - SECOND, "nothing of it is recorded").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_that_lost_its_bytes_costs_what_it_held_and_is_named() {
    let stage = Stage::new().await;
    stage.record(START, &frames("jpegenc", 40)).await;
    stage.record(START + 12 * SECOND, &frames("jpegenc", 40)).await;
    let archive = stage.archive().await;
    wait_for_survey(&archive).await;
    let row = &stage.rows().await[0];
    // Behind the archive's back, in the midst of the header.
    std::fs::OpenOptions::new().write(true).open(stage.path(row)).unwrap().set_len(100).unwrap();
    let lost = exported(&archive, &request(START, START + SECOND)).await;
    assert_eq!(lost.state, ExportState::Failed, "{lost:?}");
    assert!(lost.reason.unwrap().starts_with(&row.path));
    let both = exported(&archive, &request(START, START + 13 * SECOND)).await;
    assert_eq!(both.state, ExportState::Done, "{both:?}");
    let camera = &manifest_of(&archive, &both.id).cameras[0];
    assert_eq!((camera.clips.len(), camera.gaps.len()), (1, 1));
    assert_eq!(camera.unreadable[0].recorded_in, row.path);
}

/// Waits until the archive has looked at all its files, and mended what it found.
async fn wait_for_survey(archive: &Archive) {
    while !archive.status().reconciled.is_done {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_signed_export_is_verified_wherever_it_lies() {
    let stage = Stage::new().await;
    stage.record(START, &frames("jpegenc", 40)).await;
    let archive = stage.archive().await;
    let unsigned = exported(&archive, &request(START, START + SECOND)).await;
    let path = stage.settings.folder.parent().unwrap().join("key");
    let public = SigningKey::make(&path).unwrap();
    archive.sign_exports(Arc::new(SigningKey::read(&path).unwrap()));
    let signed = exported(&archive, &request(START, START + SECOND)).await;
    let names = |status: &ExportStatus| status.files.iter().map(|file| file.file.clone()).collect::<Vec<_>>();
    assert_eq!(names(&signed)[..2], ["manifest.json", "signature.json"]);
    assert!(!names(&unsigned).contains(&"signature.json".to_owned()));
    archive.stop();
    drop(archive);
    let archive = stage.archive().await;
    for _ in 0..500 {
        if !archive.exports().list().is_empty() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(archive.exports().list(), [unsigned.clone(), signed.clone()]);
    let folder = |of: &ExportStatus| stage.settings.folder.join("exported.clips").join(&of.id);
    let found = verify_export(&folder(&unsigned)).unwrap();
    assert_eq!((found.n_clips, found.signed_by, found.faults.len()), (1, None, 0));
    let folder = folder(&signed);
    let found = verify_export(&folder).unwrap();
    assert_eq!((found.signed_by, found.faults), (Some(public), vec![]));
    // Every byte of it is held.
    let changed = |name: &str, from: &str, to: &str| {
        let file = folder.join(name);
        let before = std::fs::read(&file).unwrap();
        let at = before.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
        let mut after = before.clone();
        after.splice(at..at + from.len(), to.bytes());
        std::fs::write(&file, after).unwrap();
        let found = verify_export(&folder).unwrap();
        std::fs::write(&file, before).unwrap();
        (found.signed_by, found.faults)
    };
    let of_manifest = (None, vec!["signature.json: is not the signature of manifest.json".to_owned()]);
    assert_eq!(changed("manifest.json", "North", "South"), of_manifest);
    assert_eq!(
        changed("signature.json", "\"signature\": \"", "\"signature\": \"x"),
        (None, vec!["signature.json: is no signature".to_owned()])
    );
    let clip = names(&signed)[2].clone();
    let mut bytes = std::fs::read(folder.join(&clip)).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(folder.join(&clip), bytes).unwrap();
    let found = verify_export(&folder).unwrap();
    assert_eq!(
        (found.signed_by, found.faults),
        (Some(public), vec![format!("{clip}: is not as the manifest has it")])
    );
    std::fs::remove_file(folder.join(&clip)).unwrap();
    assert_eq!(verify_export(&folder).unwrap().faults.len(), 1);
}
