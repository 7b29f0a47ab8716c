//! Cameras whose pictures have another shape than the one that was calibrated say so, by the newest picture and the scenes of now.

use super::{Bench, SCENE, camera, pictures};
use std::path::Path;
use std::sync::Arc;
use videofields_picture::scene;
use videofields_service::engine::CameraSummary;
use videofields_vision::config::{End, Settings};

/// Has the camera `north` of the scene `yard` play the numbered pictures in a folder once.
fn play(folder: &Path) -> Bench {
    let mut settings = Settings::default();
    settings.media.roots = vec![folder.to_path_buf()];
    settings.camera = vec![camera("north", folder.join("north/in%04d.png"), End::Stop)];
    Bench::start(folder, settings, &[("yard", SCENE)])
}

/// Turns a picture, so that it has another shape.
fn turn(folder: &Path, number: u32) {
    let path = folder.join(format!("north/in{number:04}.png"));
    image::open(&path).unwrap().rotate90().save(path).unwrap();
}

fn stretched(summary: &CameraSummary) -> Vec<(&str, [u32; 2])> {
    summary.stretched.iter().map(|of| (of.scene.as_str(), of.calibrated_px)).collect()
}

#[test]
fn a_calibration_of_another_shape_is_told_until_it_is_mended() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), "north", 0..4);
    (0..4).for_each(|number| turn(folder.path(), number));
    let bench = play(folder.path());
    let ended = bench.wait_for_state("north", "ended");
    assert_eq!((ended.size_px, stretched(&ended)), (Some([48, 64]), vec![("yard", [64, 48])]));
    let expected = "its pictures are 48 x 64, but scene yard has a calibration of 64 x 48, which is another shape: they are \
                    stretched onto the scene";
    assert_eq!(ended.reason.as_deref(), Some(expected));

    let mended = SCENE.replace("[64, 48]", "[60, 80]");
    let mended = Arc::new(scene::parse("yard", &mended, scene::no_imports).unwrap().scene);
    bench.handle.put_scene(mended).unwrap();
    let summary = bench.summary("north");
    assert_eq!(
        (stretched(&summary), summary.reason.as_deref()),
        (vec![], None),
        "another size of the same shape"
    );
}

#[test]
fn the_newest_picture_s_shape_counts() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), "north", 0..6);
    (3..6).for_each(|number| turn(folder.path(), number));
    let bench = play(folder.path());
    let ended = bench.wait_for_state("north", "ended");
    assert_eq!(stretched(&ended), [("yard", [64, 48])]);
    let reason = ended.reason.unwrap();
    assert!(reason.contains("several sizes: 64 x 48 at first, 48 x 64 in in0003.png"), "{reason}");
}
