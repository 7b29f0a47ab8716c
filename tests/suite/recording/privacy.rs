//! What is recorded of a camera of which nobody may see all, and what of that which was recorded before.

use super::{FRAME_NANOS, Numbered, RATE_HZ, Running, START, film, start, wait_for};
use crate::engine::privacy::{RIGHT, hides, zone};
use serde_json::json;
use std::time::Duration;
use videofields::archive::ExportState;
use videofields::engine::{At, LiftedZone, Privacy};
use videofields::error::ErrorKind;
use videofields::frame::Zone;

fn wait_for_end(running: &Running) {
    wait_for("the cameras' end", || {
        running.handle.cameras().iter().all(|camera| camera.state == "ended").then_some(())
    });
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
