//! Clips and previews of what a running daemon recorded.

use super::{FRAME_NANOS, Numbered, RATE_HZ, Running, START, film, number_of, start, wait_for};
use crate::engine::pictures;
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use videofields_recording::archive::{ExportState, Manifest};
use videofields_recording::media::{Decoder, Input, descriptor_path};
use videofields_service::engine::EngineError;
use videofields_vision::access::{Grants, Rights, Role};

/// The numbers that are burned into a file's pictures, and their times in it.
pub(super) fn numbers(path: &Path) -> Vec<(u64, i64)> {
    let mut decoder = Decoder::start(Input::file(path).unwrap(), None).unwrap();
    let mut seen = Vec::new();
    while !decoder.has_ended() {
        if let Some(picture) = decoder.pull(Duration::from_millis(50)) {
            seen.push((number_of(&picture.image), picture.stream_nanos.unwrap()));
        }
        assert!(decoder.fault().is_none());
    }
    seen
}

fn wait_for_end(running: &Running) {
    wait_for("the cameras' end", || {
        running.handle.cameras().iter().all(|camera| camera.state == "ended").then_some(())
    });
}

#[test]
fn a_stretch_is_exported_and_previewed_while_the_daemon_runs() {
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
    let asked =
        json!({"scene": "yard", "from": at(50).to_string(), "to": at(120).to_string(), "note": "case 7"});
    let asked = running.handle.ask_export(asked, Some("ann")).unwrap();
    let done = wait_for("the export", || {
        let status = running.handle.exports().into_iter().find(|status| status.id == asked.id).unwrap();
        assert_ne!(status.state, ExportState::Failed, "{status:?}");
        (status.state == ExportState::Done).then_some(status)
    });
    // The other camera is not of the scene.
    assert_eq!((done.cameras.as_slice(), done.note.as_str()), (["north".to_owned()].as_slice(), "case 7"));
    let (file, _) = running.handle.export_file(&done.id, "manifest.json").unwrap();
    let manifest: Manifest = serde_json::from_reader(file).unwrap();
    let [camera] = manifest.cameras.as_slice() else { panic!("{manifest:?}") };
    assert!(camera.calibrations["yard"]["focal_px"][0].as_f64().unwrap() > 0.0);
    let [clip] = camera.clips.as_slice() else { panic!("{camera:?}") };
    assert_eq!((clip.first_at.clone(), camera.gaps.len()), (at(45).to_string(), 0));
    let (file, _) = running.handle.export_file(&done.id, &clip.file).unwrap();
    let seen = numbers(&descriptor_path(&file));
    let expected: Vec<_> = (0..75).map(|i| (45 + i as u64, i * FRAME_NANOS)).collect();
    assert_eq!(seen[..75], expected);
    let refused = running.handle.export_file(&done.id, "../v.sqlite").unwrap_err();
    assert!(matches!(refused, EngineError::NoExportFile { .. }));
    // Operators remove their own alone.
    let operator = Arc::new(Grants::new(Role::Operator, Rights::ALL, [].into()));
    let operators = running.handle.within(operator);
    for user in [Some("eve"), None] {
        let refused = operators.remove_export(&done.id, user).unwrap_err();
        assert!(matches!(refused, EngineError::Forbidden(_)), "{refused:?}");
    }
    operators.remove_export(&done.id, Some("ann")).unwrap();
    assert_eq!(running.handle.exports(), []);

    // A preview is near enough, and says when it was seen.
    for number in [0, 7, 44, 61, 99, 104, 118] {
        for reach_frames in [1, 4, 20] {
            let reach = Duration::from_nanos((reach_frames * FRAME_NANOS) as u64);
            let preview = running.handle.preview("north", at(number), reach).unwrap();
            let away = preview.timestamp.nanos_since(at(number)).abs();
            assert!(away <= reach_frames * FRAME_NANOS, "{number}: {away}");
            assert_eq!(at(number_of(&preview.image) as i64), preview.timestamp);
        }
    }
    running.stop();
}

#[test]
fn numbered_pictures_are_recorded_as_jpeg() {
    let folder = tempfile::tempdir().unwrap();
    let path = pictures(folder.path(), "png", 0..60);
    let camera = format!(
        "[[camera]]\nid = \"north\"\n[camera.source]\npath = \"{}\"\nrate_hz = {RATE_HZ}\nstart = \"{START}\"\n",
        path.display()
    );
    let mut running = start(folder.path(), &camera);
    wait_for_end(&running);
    running.stop();
    let originals: Vec<_> = (0..60)
        .map(|number| image::open(folder.path().join(format!("png/in{number:04}.png"))).unwrap().to_luma8())
        .collect();
    std::fs::remove_dir_all(folder.path().join("png")).unwrap();

    let mut running = start(folder.path(), &camera);
    for (original, number) in originals.iter().zip(0_i64..) {
        let at = START.saturating_add_nanos(number * FRAME_NANOS);
        let seen = running.handle.preview("north", at, Duration::ZERO).unwrap();
        assert_eq!(seen.timestamp, at);
        let luma = seen.image.plane(0);
        let pairs = (0..luma.height).flat_map(|y| luma.row(y)).zip(original.as_raw());
        let total: u64 = pairs.map(|(seen, original)| u64::from(seen.abs_diff(*original))).sum();
        assert!(total < 3 * original.as_raw().len() as u64, "{number}: {total}");
    }
    running.stop();
}
