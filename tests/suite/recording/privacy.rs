//! What is recorded of a camera of which nobody may see all, and what of that which was recorded before.

use super::{FRAME_NANOS, Numbered, RATE_HZ, Running, START, film, start, wait_for};
use crate::engine::pictures;
use crate::engine::privacy::{RIGHT, hides, others, zone};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;
use videofields::archive::ExportState;
use videofields::engine::{At, LiftedZone, Privacy};
use videofields::error::ErrorKind;
use videofields::frame::Zone;

/// Bytes of all files beneath a folder, by their places in it.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let place = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(place, std::fs::read(path).unwrap());
            }
        }
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
fn recordings_of_two_worlds_that_differ_within_a_zone_alone_are_the_same_files() {
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
        let state = running.handle.cameras().remove(0);
        assert_eq!(state.recording.unwrap().frames, 20, "{:?}", state.reason);
        running.stop();
        let found = files(&folder.path().join("recorded"));
        let found: BTreeMap<_, _> =
            found.into_iter().filter(|(path, _)| path.extension().is_some_and(|end| end == "mkv")).collect();
        assert!(!found.is_empty());
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
    let export = running.handle.ask_export(asked.clone()).unwrap();
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
    let refused = running.handle.ask_export(asked.clone()).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::Conflict, "{refused}");
    let refused = wait_for("the export", || {
        let file = running.handle.export_file(&export.id, "manifest.json");
        file.err().filter(|error| error.kind() != ErrorKind::NotFound)
    });
    assert_eq!(refused.kind(), ErrorKind::Conflict, "{refused}");
    // Lifted, it still hides what was seen until then.
    let lifted = LiftedZone { zone: hidden.clone(), until: at(70) };
    hold(&[], &[lifted], 2);
    assert_eq!([seen(5), seen(69), seen(70)], [[true; 3], [true; 3], [false; 3]]);
    assert_eq!(running.handle.ask_export(asked).unwrap_err().kind(), ErrorKind::Conflict);
    let later = json!({"cameras": ["north"], "from": at(70).to_string(), "to": at(90).to_string()});
    running.handle.ask_export(later).unwrap();
    running.stop();
}
