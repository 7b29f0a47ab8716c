//! A camera whose picture hangs says so while its frames go on, and says when that is over.

use super::{Bench, RATE_HZ, camera, pictures, wait_for};
use videofields_recording::timeline::EventKind;
use videofields_vision::config::{End, Settings};

#[test]
fn a_picture_that_hangs_shows_as_frozen_until_it_changes_again() {
    let folder = tempfile::tempdir().unwrap();
    let moving = pictures(folder.path(), "hangs", 0..30);
    let last = folder.path().join("hangs/in0029.png");
    // Two seconds of the same picture, again and again.
    for number in 30..30 + 2 * RATE_HZ as u32 {
        std::fs::copy(&last, folder.path().join(format!("hangs/in{number:04}.png"))).unwrap();
    }
    let mut settings = Settings::default();
    settings.media.roots = vec![folder.path().to_path_buf()];
    let mut hangs = camera("hangs", &moving, End::Loop);
    hangs.condition.frozen_after_secs = 1.0;
    settings.camera = vec![hangs];
    let bench = Bench::start(folder.path(), settings, &[]);

    let frozen = bench.wait_for_state("hangs", "frozen");
    assert!(frozen.reason.as_deref().unwrap().starts_with("the picture is frozen since "), "{frozen:?}");
    wait_for("frames to go on", || Some(()).filter(|()| bench.summary("hangs").frames > frozen.frames));
    let live = bench.wait_for_state("hangs", "live");
    assert_eq!(live.reason, None);
    let told = bench.handle.events(Some("hangs"), 0, 100).unwrap();
    let ends: Vec<_> = told
        .iter()
        .filter(|logged| logged.event.kind == EventKind::Frozen)
        .map(|logged| logged.event.is_end)
        .take(2)
        .collect();
    assert_eq!(ends, [false, true]);
}
