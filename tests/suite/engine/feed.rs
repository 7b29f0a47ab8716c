//! What feeds a camera is changed while all others run.

use super::{Bench, camera, pictures, wait_for};
use serde_json::json;
use std::time::Duration;
use videofields_service::engine::{At, EngineError};
use videofields_vision::config::{End, Settings};

#[test]
fn a_camera_is_stopped_moved_and_fed_from_elsewhere_while_another_runs_on() {
    let folder = tempfile::tempdir().unwrap();
    let first = pictures(folder.path(), "first", 0..6);
    let second = pictures(folder.path(), "second", 0..3);
    let mut settings = Settings::default();
    settings.media.roots = vec![folder.path().to_path_buf()];
    settings.camera = vec![camera("kept", &first, End::Loop), camera("changed", &first, End::Loop)];
    let bench = Bench::start(folder.path(), settings, &[]);
    let (door, last) = (&bench.handle, |id: &str| bench.handle.observation(id, At::Live).unwrap());
    bench.wait_for_state("changed", "live");
    let kept_before = bench.wait_for_state("kept", "live");

    let off = door.change_feed("changed", &json!({"enabled": false})).unwrap();
    assert!(!off.enabled);
    let summary = bench.wait_for_state("changed", "ended");
    assert_eq!(summary.reason.as_deref(), Some("switched off"));
    let n_frames = summary.frames;
    assert!(n_frames > 0);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(bench.summary("changed").frames, n_frames, "nothing comes any more");
    last("changed");

    door.change_feed("changed", &json!({"enabled": true, "source": {"path": second}})).unwrap();
    let summary = bench.wait_for_state("changed", "live");
    assert!(summary.frames > n_frames, "counts go on");
    // It names a start, long before the newest that was kept: what was kept is let go.
    let restarted = wait_for("time to begin anew", || {
        Some(last("changed").frame).filter(|frame| frame.number >= n_frames && frame.timestamp.as_nanos() > 0)
    });
    assert!(restarted.number < 1_000_000);

    door.change_feed("changed", &json!({"clock": {"offset_secs": 3600}})).unwrap();
    let hour = 3_600_000_000_000;
    wait_for("an hour to pass", || Some(()).filter(|()| last("changed").frame.timestamp.as_nanos() >= hour));
    // Well before the hour has passed.
    door.change_feed("changed", &json!({"clock": {"offset_secs": null}})).unwrap();
    wait_for("it to pass back", || Some(()).filter(|()| last("changed").frame.timestamp.as_nanos() < hour));
    assert_eq!(door.feed("changed").unwrap().clock.offset_secs, 0.0);

    let refused = door.change_feed("changed", &json!({"source": {"rate_hz": -1}})).unwrap_err();
    assert!(
        matches!(&refused, EngineError::Faults(faults) if faults[0].place == "/source/rate_hz"),
        "{refused}"
    );
    let outside = door.change_feed("changed", &json!({"source": {"path": "/etc/passwd"}}));
    assert!(outside.is_ok(), "whether a file may be read shows when it is opened");
    let failed = bench.wait_for_state("changed", "failed");
    assert!(failed.reason.unwrap().contains("media"), "outside of the media roots");
    assert!(matches!(door.change_feed("none", &json!({})), Err(EngineError::NoCamera { .. })));

    let kept = bench.summary("kept");
    assert_eq!((kept.state.as_str(), kept.retries, &kept.since), ("live", 0, &kept_before.since));
    assert!(kept.frames > kept_before.frames);
    let handle = bench.stop();
    let late = handle.change_feed("kept", &json!({"enabled": false}));
    assert!(matches!(late, Err(EngineError::Unavailable(_))));
}
