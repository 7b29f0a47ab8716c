//! What is recorded of a camera of which nobody may see all, and what of that which was recorded before.

use super::{FRAME_NANOS, Numbered, RATE_HZ, Running, START, film, start, wait_for};
use crate::engine::pictures;
use crate::engine::privacy::{RIGHT, hides, others, zone};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use videofields_api::read_view_request;
use videofields_recording::archive::{ExportState, Manifest};
use videofields_recording::media::{Decoder, Input, descriptor_path};
use videofields_recording::store::{BackgroundHistoryBounds, BackgroundRecord, TrackRecord};
use videofields_recording::telemetry::Metrics;
use videofields_service::engine::{At, BlurAsked, EngineError, LiftedZone, Privacy};
use videofields_service::evidence::{Maker, SnapshotSettings, Snapshots, Subject, Wanted};
use videofields_vision::access::Grants;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, NEUTRAL_YUV, YuvImage, Zone};

/// The pictures in all recorded files beneath a folder, JPEG, by the files' places in it. What is around them has random
/// numbers of the container's.
fn recorded_pictures(folder: &Path) -> BTreeMap<PathBuf, Vec<Vec<u8>>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "mkv") {
                let place = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(place, jpegs(&std::fs::read(path).unwrap()));
            }
        }
    }
    found
}

/// Every JPEG in some bytes: from its first marker to its last.
fn jpegs(bytes: &[u8]) -> Vec<Vec<u8>> {
    let place = |from: usize, marker: &[u8]| {
        bytes[from..].windows(marker.len()).position(|window| window == marker).map(|place| from + place)
    };
    let (mut found, mut from) = (Vec::new(), 0);
    while let Some(start) = place(from, &[0xff, 0xd8, 0xff]) {
        let Some(end) = place(start, &[0xff, 0xd9]) else { break };
        found.push(bytes[start..end + 2].to_vec());
        from = end + 2;
    }
    found
}

fn wait_for_end(running: &Running) {
    wait_for("the cameras' end", || {
        running.handle.cameras().iter().all(|camera| camera.state == "ended").then_some(())
    });
}

/// Slow enough that no frame comes too late, whatever else the machine does: such are not recorded.
const SLOW_HZ: i64 = 5;

fn camera(path: &Path, zones: &str) -> String {
    format!(
        "[[camera]]\nid = \"north\"\nprivacy_zones = [{zones}]\n[camera.source]\npath = \"{}\"\nrate_hz = {SLOW_HZ}\n\
         start = \"{START}\"\n",
        path.display()
    )
}

#[test]
fn recordings_of_two_worlds_that_differ_within_a_zone_alone_are_the_same_to_the_byte() {
    let hidden = zone("garden", &RIGHT);
    let polygon = serde_json::to_string(&RIGHT).unwrap();
    let zones = format!("{{name = \"garden\", reason = \"not ours\", polygon = {polygon}}}");
    let recorded = [false, true].map(|is_other| {
        let folder = tempfile::tempdir().unwrap();
        let path = if is_other {
            others(folder.path(), "png", 0..20, &hidden)
        } else {
            pictures(folder.path(), "png", 0..20)
        };
        let mut running = start(folder.path(), &camera(&path, &zones));
        wait_for_end(&running);
        // What the camera handed over is written a moment later.
        wait_for("all frames on the disk", || {
            let recording = running.handle.cameras().remove(0).recording?;
            (recording.frames == 20).then_some(())
        });
        running.stop();
        let found = recorded_pictures(&folder.path().join("recorded"));
        assert_eq!(found.values().map(Vec::len).sum::<usize>(), 20);
        // Played again, it shows what was recorded.
        let mut running = start(folder.path(), &camera(&path, &zones));
        let seen = running
            .handle
            .preview("north", START.saturating_add_nanos(2_000_000_000 / SLOW_HZ), Duration::ZERO)
            .unwrap();
        assert!(
            hides(&seen.image, &hidden) && seen.image.plane(0).row(20)[..30].iter().any(|luma| *luma > 120)
        );
        running.stop();
        found
    });
    assert!(recorded[0] == recorded[1], "{:?}", recorded.each_ref().map(|of| of.keys().collect::<Vec<_>>()));
}

#[test]
fn what_was_recorded_before_is_hidden_too_and_is_not_given_out_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    Numbered {
        n_frames: 130,
        rate_hz: RATE_HZ,
        encoder: "x264enc bframes=2 key-int-max=15",
        muxer: "mp4mux",
    }
    .write(&folder.path().join("film.mp4"));
    let mut running = start(folder.path(), &film());
    wait_for_end(&running);
    let at = |number: i64| START.saturating_add_nanos(number * FRAME_NANOS);
    let asked = json!({"cameras": ["north"], "from": at(10).to_string(), "to": at(60).to_string()});
    let export = running.handle.ask_export(asked.clone(), None).unwrap();
    wait_for("the export", || {
        let status = running.handle.exports().into_iter().find(|status| status.id == export.id).unwrap();
        (status.state == ExportState::Done).then_some(())
    });
    // From now on all there is was recorded.
    running.stop();
    drop(running);
    std::fs::remove_file(folder.path().join("film.mp4")).unwrap();
    let mut running = start(folder.path(), &film());
    let hidden = zone("garden", &RIGHT);
    let seen = |number: i64| {
        let preview = running.handle.preview("north", at(number), Duration::ZERO).unwrap().image;
        let observation = running.handle.observation("north", At::Time(at(number))).unwrap();
        [
            hides(&preview, &hidden),
            hides(&observation.frame.image, &hidden),
            hides(&observation.background, &hidden),
        ]
    };
    assert_eq!(seen(5), [false; 3]);
    let hold = |zones: &[Zone], lifted: &[LiftedZone], version| {
        let privacy = Privacy { zones: zones.into(), lifted: lifted.into(), version, since: None };
        running.handle.hold_privacy("north", privacy).unwrap();
    };
    hold(std::slice::from_ref(&hidden), &[], 1);
    for number in [5, 60, 125] {
        assert_eq!(seen(number), [true; 3], "{number}");
    }
    let refused = wait_for("the export", || {
        let file = running.handle.export_file(&export.id, "manifest.json");
        file.err().filter(|error| error.kind() != ErrorKind::NotFound)
    });
    assert_eq!(refused.kind(), ErrorKind::Conflict, "{refused}");
    // Asked for again it is drawn anew.
    let (manifest, shown) = exported(&running, asked.clone());
    let redrawn = manifest.cameras[0].redrawn.clone().unwrap();
    assert_eq!(
        (&redrawn["zones"], &redrawn["blurs_people"], &redrawn["frames"]),
        (&json!(["garden"]), &json!(false), &json!(50))
    );
    assert_eq!((shown.len(), manifest.cameras[0].clips[0].first_at.clone()), (50, at(10).to_string()));
    assert!(shown.iter().all(|image| nearly_hides(image, &hidden)));
    // Lifted, it still hides what was seen until then.
    let lifted = LiftedZone { zone: hidden.clone(), until: at(70) };
    hold(&[], &[lifted], 2);
    assert_eq!([seen(5), seen(69), seen(70)], [[true; 3], [true; 3], [false; 3]]);
    // What was drawn under other zones is not given out any more, and what is drawn now still hides it until then.
    let refused = running.handle.export_file(&manifest.id, "manifest.json").unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::Conflict, "{refused}");
    let asked = json!({"cameras": ["north"], "from": at(66).to_string(), "to": at(74).to_string()});
    let (_, shown) = exported(&running, asked);
    let hides: Vec<_> = shown.iter().map(|image| nearly_hides(image, &hidden)).collect();
    assert_eq!(hides, [[true; 4], [false; 4]].concat());
    let later = json!({"cameras": ["north"], "from": at(70).to_string(), "to": at(90).to_string()});
    let (manifest, _) = exported(&running, later);
    assert_eq!(manifest.cameras[0].redrawn, None, "nothing of it is hidden");
    running.stop();
}

#[test]
fn pictures_and_snapshots_of_the_past_are_hidden_by_the_zones_of_today() {
    if videofields_testing::adapter("").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film_path = folder.path().join("film.mp4");
    Numbered {
        n_frames: 130,
        rate_hz: RATE_HZ,
        encoder: "x264enc bframes=2 key-int-max=15",
        muxer: "mp4mux",
    }
    .write(&film_path);
    let mut running = start(folder.path(), &film());
    wait_for_end(&running);
    running.stop();
    drop(running);
    std::fs::remove_file(film_path).unwrap();
    let mut running = start(folder.path(), &film());
    let at = |number: i64| START.saturating_add_nanos(number * FRAME_NANOS);
    let shown = |number: i64| {
        let query = format!("width=320&height=180&t={}", at(number).as_nanos());
        let request = read_view_request("yard", &query).unwrap();
        running.runtime.block_on(running.handle.view(request)).unwrap().image.data.clone()
    };
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let settings = SnapshotSettings {
        folder: folder.path().join("snapshots"),
        max_bytes: 1 << 30,
        max_age_nanos: i64::MAX,
        min_free_bytes: 0,
        lift_window_nanos: None,
    };
    let opened = Snapshots::open(settings, running.store.clone().unwrap(), Arc::new(Metrics::new()), clock);
    let snapshots = running.runtime.block_on(opened).unwrap();
    let grants = Grants::everything();
    // The kept picture's pixels, and what is said of the camera.
    let kept = |number: i64, blur_people: Option<BlurAsked>| {
        let subject = Subject::Camera { camera: "north".to_owned(), at: At::Time(at(number)) };
        let wanted = Wanted { subject, note: String::new(), tags: Vec::new(), hold: false, blur_people };
        let maker = Maker { user: None, schedule: None, grants: &grants };
        let made = running.runtime.block_on(snapshots.make(&running.handle, maker, wanted)).unwrap();
        let place = folder.path().join("snapshots").join(&made.id);
        let record: Value =
            serde_json::from_slice(&std::fs::read(place.join("record.json")).unwrap()).unwrap();
        let picture = image::open(place.join("picture.png")).unwrap().into_rgb8().into_raw();
        (picture, record["cameras"][0].clone())
    };
    let grey = |data: &[u8]| data.chunks_exact(3).all(|pixel| pixel == &data[..3]);
    assert!(shown(5) != shown(60), "each frame has its number");
    let (plain, of_plain) = kept(5, None);
    assert_eq!((&of_plain["hidden"], &of_plain["blurred"]), (&json!([]), &Value::Null));
    // Nothing is known of who moved then: all of it is blurred.
    let (blurred, of_blurred) = kept(5, Some(BlurAsked::default()));
    assert!(plain != blurred && !grey(&plain));
    assert_eq!(of_blurred["blurred"]["whole"], json!(true));
    let whole = zone("all", &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let privacy = Privacy { zones: [whole].into(), lifted: [].into(), version: 1, since: None };
    running.handle.hold_privacy("north", privacy).unwrap();
    assert!(shown(5) == shown(60), "nothing of any frame is left in a view");
    let playhead = json!({"scene": "yard", "at": at(60).to_string(), "paused": true});
    running.handle.put_playhead("wall", playhead).unwrap();
    assert_eq!(running.handle.playhead_at("wall").unwrap(), at(60));
    for number in [5, 60, 125] {
        let (picture, of) = kept(number, None);
        assert!(grey(&picture), "{number}");
        assert_eq!(of["hidden"].as_array().unwrap().len(), 1);
        assert!(grey(&kept(number, Some(BlurAsked::default())).0), "{number}");
    }
    running.stop();
}

/// Asks for an export of one camera; its manifest, and all pictures of its clips.
fn exported(running: &Running, asked: Value) -> (Manifest, Vec<YuvImage>) {
    let asked = wait_for("the archive", || running.handle.ask_export(asked.clone(), None).ok());
    wait_for("the export", || {
        let status = running.handle.exports().into_iter().find(|status| status.id == asked.id).unwrap();
        assert_ne!(status.state, ExportState::Failed, "{status:?}");
        (status.state == ExportState::Done).then_some(())
    });
    let (file, _) = running.handle.export_file(&asked.id, "manifest.json").unwrap();
    let manifest: Manifest = serde_json::from_reader(file).unwrap();
    let mut shown = Vec::new();
    for clip in manifest.clips() {
        let (file, _) = running.handle.export_file(&asked.id, &clip.file).unwrap();
        let mut decoder = Decoder::start(Input::file(&descriptor_path(&file)).unwrap(), None).unwrap();
        while !decoder.has_ended() {
            if let Some(picture) = decoder.pull(Duration::from_millis(50)) {
                shown.push(picture.image);
            }
            assert!(decoder.fault().is_none());
        }
    }
    (manifest, shown)
}

/// As [`hides`], but for what JPEG adds at the zone's edge.
fn nearly_hides(image: &YuvImage, zone: &Zone) -> bool {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let luma = image.plane(0);
    let is_within = |x: u32, y: u32| {
        let away = [-8.0, 8.0];
        away.iter().all(|right| {
            away.iter().all(|down| {
                let place = [(f64::from(x) + right) / width, (f64::from(y) + down) / height];
                place.iter().any(|value| !(0.0..1.0).contains(value)) || zone.holds(place)
            })
        }) && zone.holds([(f64::from(x) + 0.5) / width, (f64::from(y) + 0.5) / height])
    };
    let mut pixels = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    pixels.all(|(x, y)| !is_within(x, y) || luma.row(y)[x as usize].abs_diff(NEUTRAL_YUV[0]) <= 3)
}

/// Greatest step of luma between neighbours in a row, leaving out a picture's borders.
fn sharpest(image: &YuvImage) -> u8 {
    let luma = image.plane(0);
    let rows = (2..luma.height - 2).map(|y| luma.row(y));
    let steps = rows.flat_map(|row| row.windows(2).map(|pair| pair[0].abs_diff(pair[1])));
    steps.max().unwrap()
}

/// Records somebody who walks by, of whom nothing but that is left: where the camera's pictures were, the longest track, and the
/// background that was learned.
fn recorded_walk(folder: &Path) -> (PathBuf, TrackRecord, BackgroundRecord) {
    let path = pictures(folder, "png", 0..24);
    let mut running = start(folder, &camera(&path, ""));
    wait_for_end(&running);
    let north = CameraId::new("north").unwrap();
    let store = running.store.clone().unwrap();
    running.engine.take().unwrap().stop();
    let learned = running.runtime.block_on(store.latest_background(&north)).unwrap().unwrap();
    let whole = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
    let tracks = running.runtime.block_on(store.tracks(&north, whole, None, 10)).unwrap();
    let track = tracks.into_iter().max_by_key(|track| track.ended_at.nanos_since(track.began_at));
    running.archive.stop();
    drop(running);
    std::fs::remove_dir_all(folder.join("png")).unwrap();
    (path, track.expect("a track"), learned)
}

/// Past frames from before and behind the end of a zone are looked at with one background after the other.
#[test]
fn who_stands_where_a_zone_was_lifted_is_found_in_what_was_recorded_since() {
    let folder = tempfile::tempdir().unwrap();
    let (path, track, learned) = recorded_walk(folder.path());
    let mut running = start(folder.path(), &camera(&path, ""));
    let store = running.store.clone().unwrap();
    let bounds = BackgroundHistoryBounds { count: 10, bytes: 1 << 30 };
    let of_then = BackgroundRecord { saved_at: track.began_at, ..learned };
    running.runtime.block_on(store.put_background_history(&of_then, bounds)).unwrap();
    drop(store);
    let until = track.ended_at.saturating_add_nanos(-1_000_000_000);
    let whole = zone("all", &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    let lifted = LiftedZone { zone: whole.clone(), until };
    let privacy = Privacy { zones: [].into(), lifted: [lifted].into(), version: 2, since: None };
    running.handle.hold_privacy("north", privacy).unwrap();
    let seen = |nanos: i64| {
        running.handle.observation("north", At::Time(until.saturating_add_nanos(nanos))).unwrap()
    };
    let before = seen(-400_000_000);
    assert!(
        hides(&before.frame.image, &whole) && hides(&before.background, &whole) && before.blobs.is_empty()
    );
    let after = seen(400_000_000);
    assert!(!hides(&after.frame.image, &whole));
    assert!(!after.blobs.is_empty(), "who stands there was taken for background");
    running.stop();
}

#[test]
fn people_in_exports_cannot_be_told_but_those_who_may_be_seen() {
    let folder = tempfile::tempdir().unwrap();
    // What was learned becomes the background of that time, and what went by is known.
    let (path, track, learned) = recorded_walk(folder.path());
    let running = start(folder.path(), &camera(&path, ""));
    let store = running.store.clone().unwrap();
    let span = |more: Value| {
        // Where it stood first it was taken for background, which is never blurred.
        let (from, to) = (track.began_at.saturating_add_nanos(1_000_000_000), track.ended_at);
        let (from, to) = (from.to_string(), to.to_string());
        json!({"cameras": ["north"], "from": from, "to": to, "blur_people": more})
    };
    let (plain, shown) = exported(&running, span(Value::Null));
    assert!(plain.cameras[0].redrawn.is_none() && shown.iter().all(|image| sharpest(image) > 90));
    // Nothing is known of that time yet: all of it is blurred.
    let (manifest, shown) = exported(&running, span(json!({})));
    let redrawn = manifest.cameras[0].redrawn.clone().unwrap();
    assert!(
        redrawn["frames"].as_u64().unwrap() > 5 && redrawn["frames"] == redrawn["frames_blurred_whole"],
        "{redrawn}"
    );
    assert!(
        shown.iter().all(|image| sharpest(image) < 40),
        "{:?}",
        shown.iter().map(sharpest).collect::<Vec<_>>()
    );
    let bounds = BackgroundHistoryBounds { count: 10, bytes: 1 << 30 };
    let of_then = BackgroundRecord { saved_at: track.began_at, ..learned };
    running.runtime.block_on(store.put_background_history(&of_then, bounds)).unwrap();
    let (manifest, shown) = exported(&running, span(json!({})));
    let redrawn = manifest.cameras[0].redrawn.clone().unwrap();
    assert_eq!(redrawn["frames_blurred_whole"], 0, "{redrawn}");
    assert!(
        shown.iter().all(|image| sharpest(image) < 40),
        "{:?}",
        shown.iter().map(sharpest).collect::<Vec<_>>()
    );
    // Whoever may be seen is.
    let who = json!({"camera": "north", "track": track.number, "at": track.began_at.to_string()});
    let (manifest, shown) = exported(&running, span(json!({"except": [who]})));
    assert_eq!(manifest.cameras[0].redrawn.clone().unwrap()["except"].as_array().unwrap().len(), 1);
    let n_sharp = shown.iter().filter(|image| sharpest(image) > 90).count();
    assert!(n_sharp * 10 >= shown.len() * 8, "{n_sharp} of {}", shown.len());
    // And nobody whom nobody knows.
    let stranger = json!({"camera": "north", "track": 999, "at": track.began_at.to_string()});
    let refused = running.handle.ask_export(span(json!({"except": [stranger]})), None).unwrap_err();
    assert!(
        matches!(&refused, EngineError::Faults(faults) if faults[0].place == "/blur_people/except/0"),
        "{refused}"
    );
    let elsewhere = json!({"camera": "west", "track": 1, "at": track.began_at.to_string()});
    let refused = running.handle.ask_export(span(json!({"except": [elsewhere]})), None).unwrap_err();
    assert!(
        matches!(&refused, EngineError::Faults(faults) if faults[0].place == "/blur_people/except/0/camera"),
        "{refused}"
    );
    drop(store);
    let mut running = running;
    running.stop();
}
