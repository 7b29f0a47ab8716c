//! Mesh sequences from videos, from the simulator, from real pictures, and on the command line.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use glam::DVec3;
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};
use videofields_lab::world_sequence::{SequenceOptions, write_sequence};
use videofields_recording::ingest::MediaRoots;
use videofields_service::sequence::Sequence;
use videofields_simulate::World;
use videofields_testing::real_data;
use videofields_testing::video::{Numbered, number_of};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::frame::{ColorMatrix, ColorRange, RgbImage, YuvImage};
use videofields_vision::geometry::Camera;
use videofields_vision::mesh::Mesh;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_videofields")).arg("sequence").args(arguments).output().unwrap()
}

fn told(arguments: &[&str]) -> Value {
    let output = run(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn triangle() -> Vec<u8> {
    let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
    let mut bytes = Vec::new();
    mesh.write_ply(&mut bytes).unwrap();
    bytes
}

fn number(picture: &RgbImage) -> u64 {
    number_of(&YuvImage::from_rgb(picture, ColorMatrix::Bt601, ColorRange::Limited).unwrap())
}

#[test]
fn pictures_of_videos_are_found_by_time_forwards_backwards_and_far_away() {
    let folder = tempfile::tempdir().unwrap();
    let film = Numbered {
        n_frames: 200,
        rate_hz: 25,
        encoder: "vp8enc deadline=1 keyframe-max-dist=30",
        muxer: "webmmux",
    };
    film.write(&folder.path().join("film.webm"));
    std::fs::write(folder.path().join("a.ply"), triangle()).unwrap();
    let camera = Camera::pinhole(DVec3::ONE, DVec3::ZERO, 0.8, (192, 96)).unwrap();
    let calibration = serde_json::to_value(CameraDocument::from_camera(&camera)).unwrap();
    // Meshes at 10 a second from 0 to 9 s; the film begins 0.5 s after the first one and has 8 s.
    let open = |pictures: Value| {
        let document = json!({
            "version": 1, "rate_hz": 10, "meshes": {"list": vec!["a.ply"; 90]},
            "cameras": [{"id": "film", "calibration": calibration, "pictures": pictures}],
        });
        std::fs::write(folder.path().join("sequence.json"), document.to_string()).unwrap();
        Sequence::open(folder.path(), &MediaRoots::new(&[folder.path().to_path_buf()]).unwrap()).unwrap()
    };
    for pictures in [
        json!({"video": "film.webm", "offset_secs": 0.5}),
        json!({"video": "film.webm", "offset_secs": 0.5, "rate_hz": 25}),
    ] {
        let mut sequence = open(pictures.clone());
        let order = (0..90).chain([80, 7, 6, 50, 5, 84, 0, 12]).chain((20..40).rev());
        for idx in order {
            let secs = f64::from(idx) / 10.0 - 0.5;
            let found = sequence.picture(idx as usize, 0).unwrap().map(|picture| number(&picture));
            let expected = (secs * 25.0).round();
            if (0.0..=199.0).contains(&(secs * 25.0)) {
                // Half-way between two either will do.
                let found = found.unwrap_or_else(|| panic!("{pictures}: none at {secs}")) as f64;
                assert!(
                    (found - secs * 25.0).abs() <= 0.5 + 1e-9,
                    "{pictures}: {found} at {secs}, not {expected}"
                );
            } else if !(-1.0..=200.5).contains(&(secs * 25.0)) {
                assert_eq!(found, None, "{pictures}: {secs}");
            }
        }
    }
    let mut sequence = open(json!({"video": "a.ply"}));
    assert!(sequence.picture(0, 0).unwrap_err().to_string().contains("a.ply"));
}

fn small(out: &Path) -> SequenceOptions {
    SequenceOptions {
        seconds: 0.3,
        from_secs: 3.0,
        size_px: Some((320, 180)),
        samples_per_side: 1,
        step_m: 0.08,
        ..SequenceOptions::new(out)
    }
}

#[test]
fn a_simulated_sequence_is_whole_and_is_seen_as_a_camera_that_was_held_back_saw_it() {
    let folder = tempfile::tempdir().unwrap();
    let n_frames = write_sequence(&World::plaza(), &small(folder.path()), |_, _| ()).unwrap();
    assert_eq!(n_frames, 3);
    let manifest = folder.path().to_str().unwrap();
    let found = told(&["check", manifest, "--json"]);
    assert_eq!(
        (&found["n_frames"], &found["n_faults"], &found["n_changed"]),
        (&json!(3), &json!(0), &json!(2))
    );
    let camera = found["cameras"][0]["id"].as_str().unwrap().to_owned();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let mut errors = Vec::new();
    for fields in ["off", "normals", "montage"] {
        let played = told(&[
            "play",
            "--manifest",
            manifest,
            "--out",
            out,
            "--hold-back",
            &camera,
            "--fps",
            "10",
            "--fields",
            fields,
            "--json",
        ]);
        assert_eq!((&played["n_pictures"], &played["n_without"]), (&json!(3), &json!(0)));
        assert_eq!(played["held_back"]["n_compared"], json!(3));
        errors.push(played["held_back"]["rmse"].as_f64().unwrap());
    }
    assert!(errors.iter().all(|rmse| *rmse < 60.0), "{errors:?}");
    let picture = image::open(folder.path().join("out/00002.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (320, 180));

    // A frame that is gone, and one that is broken, are told; the rest is played.
    std::fs::write(folder.path().join("mesh/00001.ply"), b"ply\n").unwrap();
    let output = run(&["play", "--manifest", manifest, "--out", out, "--view", &camera, "--fps", "10"]);
    assert!(!output.status.success());
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(
        text.contains("frame 1 cannot be read") && text.contains("1 of 3 pictures show no frame"),
        "{text}"
    );
    let output = run(&["check", manifest]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("fault: frame 1 cannot be read"));
}

#[test]
fn commands_refuse_what_cannot_be_with_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let refused = |arguments: &[&str], says: &str| {
        let output = run(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && text.contains(says), "{arguments:?}: {text}");
    };
    refused(&["check", path], "there is no sequence.json in this folder");
    refused(&["check", "/nowhere/at/all"], "cannot read /nowhere/at/all");
    std::fs::write(folder.path().join("a.ply"), triangle()).unwrap();
    let document = json!({"version": 1, "meshes": {"list": ["a.ply"]}});
    std::fs::write(folder.path().join("sequence.json"), document.to_string()).unwrap();
    let out = folder.path().join("out");
    let play = ["play", "--manifest", path, "--out", out.to_str().unwrap()];
    let and = |more: &[&'static str]| [&play[..], more].concat();
    refused(&and(&[]), "name where to look from");
    refused(&and(&["--view", "north"]), "there is no camera north");
    refused(&and(&["--eye", "1,2"]), "x,y,z");
    refused(&and(&["--eye", "1,2,3"]), "--target");
    refused(&and(&["--eye", "1,2,3", "--target", "0,0,0", "--rate", "0"]), "--rate");
    refused(&and(&["--eye", "1,2,3", "--target", "0,0,0", "--fps", "0"]), "--fps");
    refused(&and(&["--eye", "1,2,3", "--target", "0,0,0", "--from", "2", "--to", "1"]), "nothing is played");
    refused(&and(&["--eye", "1,2,3", "--target", "0,0,0", "--fields", "on"]), "off, normals, montage");
    let output = run(&and(&[
        "--eye",
        "1,2,3",
        "--target",
        "0,0,0",
        "--to",
        "0.2",
        "--orbit",
        "-90",
        "--size-px",
        "32x16",
    ]));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 6);
}

/// A COLMAP model of a triangle whose world has -y up, in centimetres.
#[test]
fn a_colmap_model_becomes_a_sequence_in_the_world() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(place("images/left")).unwrap();
    let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([200, 100, 50]));
    picture.save(place("images/left/Photo 1.PNG")).unwrap();
    picture.save(place("images/b.png")).unwrap();
    std::fs::write(place("cameras.txt"), "1 SIMPLE_RADIAL 64 48 50 32 24 -0.05\n").unwrap();
    // Cameras as the world's axes have it: x right, y down, z forward, 300 behind the mesh.
    let images = "1 1 0 0 0 0 0 300 1 left/Photo 1.PNG\n\n2 1 0 0 0 20 0 300 1 b.png\n\n3 1 0 0 0 0 0 300 1 gone.png\n\n";
    std::fs::write(place("images.txt"), images).unwrap();
    let mesh = Mesh::new(
        vec![DVec3::new(-100.0, 50.0, 0.0), DVec3::new(0.0, -70.0, 0.0), DVec3::new(100.0, 50.0, 0.0)],
        vec![[0, 1, 2]],
    );
    let mut bytes = Vec::new();
    mesh.write_ply(&mut bytes).unwrap();
    std::fs::write(place("mesh.ply"), bytes).unwrap();
    let text = |name: &str| place(name).to_str().unwrap().to_owned();
    let convert = [
        "from-colmap".to_owned(),
        "--model".to_owned(),
        text(""),
        "--images".to_owned(),
        text("images"),
        "--mesh".to_owned(),
        text("mesh.ply"),
        "--metres-per-unit".to_owned(),
        "0.01".to_owned(),
        "--out".to_owned(),
        text("made"),
    ];
    let convert: Vec<&str> = convert.iter().map(String::as_str).collect();
    let output = run(&convert);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains("gone.png has no picture") && errors.contains("-y of the set"), "{errors}");
    let sequence =
        Sequence::open(&place("made"), &MediaRoots::new(&[folder.path().to_path_buf()]).unwrap()).unwrap();
    let mesh = sequence.mesh(0).unwrap().mesh;
    let [low, high] = mesh.bounds().unwrap();
    assert!(
        (low - DVec3::new(-1.0, 0.0, -0.5)).length() < 1e-6
            && (high - DVec3::new(1.0, 0.0, 0.7)).length() < 1e-6
    );
    let ids: Vec<&str> = sequence.cameras().iter().map(|camera| camera.id.as_str()).collect();
    assert_eq!(ids, ["photo-1", "b"]);
    let camera = &sequence.cameras()[0].camera;
    assert!((camera.pose().position_in_world - DVec3::new(0.0, -3.0, 0.0)).length() < 1e-9);
    // The top of the mesh is at the top of the picture.
    let seen = camera.project(DVec3::new(0.0, 0.0, 0.7)).unwrap();
    assert!(seen.texture.y < 0.4 && (seen.texture.x - 0.5).abs() < 1e-9 && (seen.depth_m - 3.0).abs() < 1e-9);
    let found = told(&["check", &text("made"), "--json"]);
    assert_eq!((&found["n_faults"], &found["cameras"][1]["n_pictures"]), (&json!(0), &json!(1)));
}

#[test]
fn a_real_castle_becomes_a_sequence() {
    let Some(folder) = real_data("sceaux_castle/cameras.json") else { return };
    let folder = folder.parent().unwrap().to_path_buf();
    let out = tempfile::tempdir().unwrap();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let convert = [
        "from-set",
        "--cameras",
        &text(&folder.join("cameras.json")),
        "--images",
        &text(&folder.join("images")),
        "--mesh",
        &text(&folder.join("scene_mesh.ply")),
        "--out",
        &text(out.path()),
    ]
    .map(str::to_owned);
    let output = run(&convert.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found = told(&["check", &text(out.path()), "--json"]);
    assert_eq!((found["cameras"].as_array().unwrap().len(), &found["n_faults"]), (10, &json!(0)));
}

#[test]
fn a_scene_shows_a_recorded_sequence_to_who_looks_at_it() {
    let folder = tempfile::tempdir().unwrap();
    let people = folder.path().join("people");
    write_sequence(&World::plaza(), &small(&people), |_, _| ()).unwrap();
    let roots = MediaRoots::new(&[folder.path().to_path_buf()]).unwrap();
    let sequence = Sequence::open(&people, &roots).unwrap();
    let first = sequence.mesh(0).unwrap().mesh.positions_m[0];
    let scene = |repeats: bool| {
        let document = json!({
            "version": 1, "ground": [{"polygon": [[-40, -40], [40, -40], [40, 40], [-40, 40]]}],
            "sequences": [{"id": "people", "file": "people", "repeats": repeats}],
        });
        std::fs::write(folder.path().join("place.json"), document.to_string()).unwrap();
    };
    let config = folder.path().join("daemon.toml");
    std::fs::write(&config, "[[scene]]\nid = \"place\"\nfile = \"place.json\"\n").unwrap();
    let drawn = |name: &str, more: &[&str]| -> Option<Vec<u8>> {
        let out = folder.path().join(name);
        let at = |over: DVec3| format!("{},{},{}", first.x + over.x, first.y + over.y, 1.0 + over.z);
        let eye = format!("--eye={}", at(DVec3::new(0.9, -3.0, 0.7)));
        let target = format!("--target={}", at(DVec3::ZERO));
        let output = Command::new(env!("CARGO_BIN_EXE_videofields"))
            .args(["view", "--config", config.to_str().unwrap(), "--scene", "place", &eye, &target])
            .args(["--fov", "45", "--width", "160", "--height", "120", "--out", out.to_str().unwrap()])
            .args(more)
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        if !output.status.success() {
            assert!(told.contains("no GPU") || told.contains("adapter"), "{told}");
            return None;
        }
        Some(image::open(&out).unwrap().to_rgb8().into_raw())
    };
    scene(true);
    // Without anything to draw with nothing is drawn, which other tests tell.
    let Some(shown) = drawn("live.png", &["--fields", "montage"]) else { return };
    scene(false);
    let absent = drawn("late.png", &["--t", "900000000000"]).unwrap();
    let recorded = drawn("then.png", &["--t", &sequence.frames()[0].at.as_nanos().to_string()]).unwrap();
    let apart = |a: &[u8], b: &[u8]| a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 10).count();
    assert!(apart(&shown, &absent) > 500 && apart(&recorded, &absent) > 500);
    // What is wrong with one is told before a daemon meets it.
    std::fs::write(people.join("sequence.json"), r#"{"version": 1, "meshes": {"pattern": "mesh/%05d.ply"}}"#)
        .unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_videofields"))
        .args(["check-config", config.to_str().unwrap()])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && told.contains("sequence people: ") && told.contains("/rate_hz"),
        "{told}"
    );
}
