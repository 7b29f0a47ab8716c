//! Every command that is no daemon, once: its results, and what it says to nonsense.

use super::process::{Output, run, videofields};
use crate::engine::pictures;
use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;
use tempfile::TempDir;
use videofields_render::gpu::Gpu;
use videofields_simulate::{SimulateOptions, World};
use videofields_testing::onvif::{Oddities, OnvifDevice, PASSWORD, USER};

fn in_folder(folder: &Path, arguments: &[&str]) -> Output {
    run(videofields().current_dir(folder).args(arguments))
}

fn check_refused(folder: &Path, arguments: &[&str], status: i32, expected: &str) {
    let output = in_folder(folder, arguments);
    assert_eq!(output.status, Some(status), "{arguments:?}: {}", output.stderr);
    assert!(output.stderr.contains(expected), "{arguments:?}: {expected:?} is not in {}", output.stderr);
    assert_eq!(output.stdout, "", "{arguments:?}");
}

fn succeed(folder: &Path, arguments: &[&str]) -> Output {
    let output = in_folder(folder, arguments);
    assert_eq!(output.status, Some(0), "{arguments:?}: {}", output.stderr);
    output
}

/// Simulated once, then read by every command: what one writes the others understand.
#[test]
fn what_is_simulated_is_checked_segmented_viewed_and_compared() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let options = SimulateOptions {
        seconds: Some(1.5),
        size_px: Some((96, 54)),
        samples_per_side: 1,
        ..SimulateOptions::new(folder.join("world"))
    };
    videofields_simulate::write(&World::named("plaza").unwrap(), &options).unwrap();

    let checked = succeed(folder, &["check-config", "world/plaza.toml"]);
    assert_eq!(
        (checked.stdout.as_str(), checked.stderr.as_str()),
        ("world/plaza.toml: good, 3 cameras, 1 scenes\n", "")
    );
    its_faults_are_found(folder);
    masks_and_blobs_are_written(folder);
    links_are_followed(folder);
    views_are_drawn(folder);

    let truth = "world/truth/west/frame/000000.png";
    let same = succeed(folder, &["compare", truth, truth]);
    let same: Value = serde_json::from_str(&same.stdout).unwrap();
    assert_eq!((&same["rmse"], &same["psnr_db"], &same["ssim"]), (&0.0.into(), &Value::Null, &1.0.into()));
    let other =
        ["compare", truth, "world/truth/east/frame/000000.png", "--mask", "world/truth/west/background.png"];
    let other: Value = serde_json::from_str(&succeed(folder, &other).stdout).unwrap();
    assert!(other["rmse"].as_f64().unwrap() > 1.0 && other["ssim"].as_f64().unwrap() < 0.999, "{other}");
    check_refused(folder, &["compare", truth, "masks/000000.png", "--mask", "nowhere.png"], 1, "nowhere.png");
    check_refused(folder, &["compare", truth, "world/plaza.toml"], 1, "world/plaza.toml");

    let calibration = succeed(folder, &["calibration", "world/calibration/west.json"]);
    let document: Value = serde_json::from_str(&calibration.stdout).unwrap();
    assert_eq!(document["image_size_px"], serde_json::json!([96, 54]));
    let again = folder.join("again.json");
    std::fs::write(&again, &calibration.stdout).unwrap();
    assert_eq!(succeed(folder, &["calibration", "again.json"]).stdout, calibration.stdout);
    check_refused(folder, &["calibration", "world/plaza.toml"], 1, "world/plaza.toml");
    check_refused(folder, &["calibration", "again.json", "--format", "colmap"], 2, "--format");
    check_refused(folder, &["calibration", "again.json", "--image-size-px", "0x5"], 2, "--image-size-px");
}

#[test]
fn cameras_are_asked_by_their_address_and_told_as_a_configuration() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let device = OnvifDevice::start(Oddities { ahead_secs: 37, ..Oddities::default() });
    std::fs::write(folder.join("gates.password"), PASSWORD).unwrap();
    let login = format!(
        "id = \"gates\"\nuser = \"{USER}\"\npassword_file = \"gates.password\"\nnetworks = [\"127.0.0.1\"]\n"
    );
    std::fs::write(folder.join("site.toml"), format!("[[credentials]]\n{login}")).unwrap();
    let address = device.address().to_string();
    let asked = ["cameras", "discover", "--config", "site.toml", "--address", &address];
    let with = |more: &[&str]| succeed(folder, &[&asked, more].concat());
    let told = with(&["--credentials", "gates"]);
    assert!(
        told.stdout.contains("s ahead of this machine's") && told.stderr.is_empty(),
        "{} {}",
        told.stdout,
        told.stderr
    );
    let site = format!("[[credentials]]\n{login}{}", told.stdout);
    std::fs::write(folder.join("site.toml"), site).unwrap();
    let checked = succeed(folder, &["check-config", "site.toml"]);
    assert!(checked.stdout.contains("good, 1 cameras"), "{}", checked.stdout);
    let told: Value = serde_json::from_str(&with(&["--credentials", "gates", "--json"]).stdout).unwrap();
    let camera = &told["devices"][0];
    assert_eq!((&camera["model"], &camera["problem"]), (&"XN-7".into(), &Value::Null));
    assert!((camera["clock"]["secs"].as_f64().unwrap() - 37.0).abs() < 5.0, "{camera}");
    assert_eq!(camera["streams"][0]["url"], "rtsp://127.0.0.1:8554/live/main?a=1&b=2");
    let shy = with(&[]).stdout;
    assert!(shy.contains("http://127.0.0.1") && shy.contains("or wants one"), "{shy}");
    check_refused(folder, &[&asked[..], &["--credentials", "gate"]].concat(), 1, "did you mean `gates`?");
    let other = ["cameras", "discover", "--config", "site.toml", "--address"];
    check_refused(folder, &[&other[..], &["u:p@127.0.0.1"]].concat(), 1, "expected a camera's address");
    check_refused(folder, &[&other[..], &["8.8.8.8"]].concat(), 1, "media.networks");
}

fn its_faults_are_found(folder: &Path) {
    let good = std::fs::read_to_string(folder.join("world/plaza.toml")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join("world").join(name), text).unwrap();
    write("broken.json", "{\"version\": 1, \"ground\": [{}]}");
    write("faulty.toml", &good.replace("plaza.json", "broken.json"));
    check_refused(folder, &["check-config", "world/faulty.toml"], 1, "broken.json: /ground/0");
    write("note.webm", "this is no video");
    write(
        "absent.toml",
        &good
            .replace("clips/west.webm", "note.webm")
            .replace("\"clips\"", "\".\"")
            .replace("\"north\"", "\"south\""),
    );
    let warned = succeed(folder, &["check-config", "world/absent.toml"]).stderr;
    assert!(warned.contains("warning: camera west: ") && warned.contains("note.webm"), "{warned}");
    assert!(warned.contains("warning: scene plaza: camera north is not configured"), "{warned}");
    assert!(warned.contains("beneath the media root"), "{warned}");

    // The camera was calibrated with pictures of another shape.
    let mut scene: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("world/plaza.json")).unwrap()).unwrap();
    let calibration = std::fs::read_to_string(folder.join("world/calibration/west.json")).unwrap();
    let mut calibration: Value = serde_json::from_str(&calibration).unwrap();
    calibration["image_size_px"] = serde_json::json!([54, 96]);
    let cameras = scene["cameras"].as_array_mut().unwrap();
    cameras.iter_mut().find(|camera| camera["id"] == "west").unwrap()["calibration"] = calibration;
    write("upright.json", &scene.to_string());
    write("upright.toml", &good.replace("plaza.json", "upright.json"));
    let warned = succeed(folder, &["check-config", "world/upright.toml"]).stderr;
    let expected = "warning: camera west: its pictures are 96 x 54, but scene plaza has a calibration of 54 x 96, which is \
                    another shape: they are stretched onto the scene\n";
    assert!(warned.ends_with(expected) && warned.lines().count() == 1, "{warned}");
}

/// The person at the command line names the files, so links are followed wherever they lead.
fn links_are_followed(folder: &Path) {
    let links = folder.join("links");
    std::fs::create_dir(&links).unwrap();
    let link = |to: &str, name: &str| {
        std::os::unix::fs::symlink(folder.join(to), links.join(name)).unwrap();
    };
    link("world/clips/west.webm", "clip.webm");
    link("world/plaza.json", "plaza.json");
    for number in 0..3 {
        link(&format!("walk/in{:04}.png", number + 7), &format!("in{number}.png"));
    }
    let clip = ["segment", "--input", "links/clip.webm", "--background", "links/clip.webm", "--frames", "3"];
    let of_scene = ["--scene", "links/plaza.json", "--camera", "west"];
    assert!(succeed(folder, &[&clip[..], &of_scene].concat()).stderr.contains("3 frames in "));
    let pictures = succeed(folder, &["segment", "--input", "links/in%d.png"]);
    assert!(pictures.stderr.contains("3 frames in "), "{}", pictures.stderr);
    let whole = succeed(folder, &["scene", "export", "world/plaza.json"]).stdout;
    assert_eq!(succeed(folder, &["scene", "export", "links/plaza.json"]).stdout, whole);
}

fn masks_and_blobs_are_written(folder: &Path) {
    // Frames are numbered from 0, whatever the pictures' names begin with.
    pictures(folder, "walk", 7..22);
    let input = ["segment", "--input", "walk/in%04d.png", "--masks", "masks", "--blobs", "blobs.jsonl"];
    let output =
        succeed(folder, &[&input[..], &["--min-area-px", "40", "--tracks", "tracks.jsonl"]].concat());
    assert!(output.stderr.contains("15 frames in "), "{}", output.stderr);
    let mut n_moving = 0;
    for number in 0..15 {
        let mask = image::open(folder.join(format!("masks/{number:06}.png"))).unwrap();
        assert_eq!((mask.color(), mask.width(), mask.height()), (image::ColorType::L8, 64, 48));
        let mask = mask.into_luma8();
        assert!(mask.as_raw().iter().all(|value| [0, 50, 255].contains(value)), "frame {number}");
        n_moving += mask.as_raw().iter().filter(|value| **value == 255).count();
    }
    assert_eq!(std::fs::read_dir(folder.join("masks")).unwrap().count(), 15);
    let blobs = std::fs::read_to_string(folder.join("blobs.jsonl")).unwrap();
    let mut area = 0;
    for line in blobs.lines() {
        let blob: Value = serde_json::from_str(line).unwrap();
        let rect: Vec<u64> = serde_json::from_value(blob["rect"].clone()).unwrap();
        let [x, y, width, height] = rect[..] else { panic!("{line}") };
        assert!(blob["frame"].as_u64().unwrap() < 15 && x + width <= 64 && y + height <= 48, "{line}");
        assert!((40..=width * height).contains(&blob["area"].as_u64().unwrap()), "{line}");
        area += blob["area"].as_u64().unwrap() as usize;
    }
    assert!(n_moving > 0, "the box walks");
    assert_eq!(area, n_moving, "every moving pixel belongs to a blob");

    let tracks = std::fs::read_to_string(folder.join("tracks.jsonl")).unwrap();
    assert!(tracks.lines().count() > 2, "the box is followed: {tracks}");
    for line in tracks.lines() {
        let track: Value = serde_json::from_str(line).unwrap();
        let rect: Vec<u64> = serde_json::from_value(track["rect"].clone()).unwrap();
        assert!(rect.len() == 4 && track["frame"].as_u64().unwrap() < 15, "{line}");
        assert!(track["id"].as_u64().unwrap() > 0 && (track["blob"].is_null() || track["blob"].is_u64()));
    }

    // A video, with a background that is learned first.
    let clip = "world/clips/west.webm";
    let held =
        ["segment", "--input", clip, "--background", clip, "--hold", "--masks", "few", "--frames", "3"];
    succeed(folder, &held);
    assert!(folder.join("few/000002.png").is_file());
    assert_eq!(std::fs::read_dir(folder.join("few")).unwrap().count(), 3);

    let refused = |flags: &[&str], status, expected: &str| {
        check_refused(folder, &[&["segment", "--input", clip], flags].concat(), status, expected);
    };
    refused(&["--delta", "nan"], 1, "--delta");
    refused(&["--delta", "5"], 1, "--delta");
    refused(&["--delta", "-1"], 1, "--delta");
    refused(&["--min-area-px", "2000000000"], 1, "--min-area-px");
    refused(&["--set", "segment.dleta=0.1"], 1, "dleta");
    refused(&["--set", "segment.delta=7"], 1, "--delta");
    refused(&["--set", "delta"], 1, "KEY=VALUE");
    refused(&["--rate-hz", "0"], 1, "--rate-hz");
    refused(&["--rate-hz", "inf"], 1, "--rate-hz");
    refused(&["--frames", "0"], 2, "--frames");
    refused(&["--delta", "much"], 2, "--delta");
    refused(&["--colour"], 2, "--colour");
    refused(&["--hold"], 2, "--background");
    refused(&["--masks", clip], 1, clip);
    refused(&["--blobs", "nowhere/blobs.jsonl"], 1, "nowhere/blobs.jsonl");
    refused(&["--tracks", "nowhere/tracks.jsonl"], 1, "nowhere/tracks.jsonl");
    refused(&["--background", "nowhere.avi"], 1, "nowhere.avi");
    check_refused(folder, &["segment", "--input", "nowhere.webm"], 1, "nowhere.webm");
    check_refused(folder, &["segment", "--input", "world/plaza.toml"], 1, "world/plaza.toml");
}

fn views_are_drawn(folder: &Path) {
    const ASKED: [&str; 9] =
        ["view", "--config", "world/plaza.toml", "--scene", "plaza", "--width", "48", "--height", "27"];
    fn view<'a>(flags: &[&'a str]) -> Vec<&'a str> {
        [&ASKED[..], flags].concat()
    }
    let refused =
        |flags: &[&str], status, expected: &str| check_refused(folder, &view(flags), status, expected);
    refused(&["--out", "view.gif"], 1, "--out");
    refused(&["--out", "view.png", "--fov", "-1"], 1, "fov");
    refused(&["--out", "view.png", "--eye", "1,2"], 1, "eye");
    refused(&["--out", "view.png", "--t", "noon"], 1, "t: ");
    refused(&["--out", "view.png", "--entities", "cubes"], 1, "entities");
    refused(&["--out", "view.png", "--depth", "3"], 2, "--depth");
    refused(&[], 2, "--out");
    let elsewhere = ["view", "--config", "world/plaza.toml", "--scene", "square", "--out", "view.png"];
    check_refused(folder, &elsewhere, 1, "\"plaza\"");
    if Gpu::new("").is_err() {
        // Whether that may be is asked where the engine is tested.
        return refused(&["--out", "view.png"], 1, "adapter");
    }
    // The simulated clips loop: an instant that they reach only after years is refused, not waited for.
    refused(&["--out", "view.png", "--t", "2026-01-01T00:00:00Z"], 1, "t: ");
    refused(&["--out", "view.png", "--t", "-5"], 1, "1970-01-01T00:00:00Z");
    refused(&["--out", "view.png", "--eye", "1,2,3", "--target", "1,2,3"], 1, "target");
    refused(&["--out", "nowhere/view.png", "--t", "0"], 1, "nowhere/view.png");
    let explained = succeed(folder, &view(&["--out", "view.png", "--t", "1000000000", "--explain"]));
    assert!(
        explained.stderr.contains("surface: ") && explained.stderr.contains("render: "),
        "{}",
        explained.stderr
    );
    succeed(
        folder,
        &view(&["--out", "view.jpg", "--entities", "points", "--eye", "-5,-12,4", "--target", "0,0,1"]),
    );
    for file in ["view.png", "view.jpg"] {
        let picture = image::open(folder.join(file)).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (48, 27), "{file}");
        let first = *picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|pixel| *pixel != first), "{file}");
    }
    let png = std::fs::read(folder.join("view.png")).unwrap();
    assert!(
        png.starts_with(b"\x89PNG")
            && std::fs::read(folder.join("view.jpg")).unwrap().starts_with(b"\xff\xd8")
    );
}

#[test]
fn commands_of_developers_say_where_they_went() {
    let folder = TempDir::new().unwrap();
    for (arguments, expected) in [
        (&["simulate", "--out", "world", "--help"][..], "videofields-lab simulate"),
        (&["accuracy"], "videofields-lab accuracy"),
        (&["bench", "views", "--world", "plaza"], "videofields-lab bench"),
        (&["sequence", "simulate", "--out", "walk"], "videofields-lab sequence"),
    ] {
        check_refused(folder.path(), arguments, 1, expected);
    }
    let help = run(videofields().arg("--help")).stdout;
    let is_listed = |command: &str| help.lines().any(|line| line.trim_start().starts_with(command));
    assert!(is_listed("segment ") && !is_listed("simulate ") && !is_listed("bench "), "{help}");
}

#[test]
fn help_says_what_every_command_and_flag_is_for() {
    let check = |arguments: &[&str], expected: &[&str]| {
        let output = run(videofields().args(arguments).arg("--help"));
        assert_eq!((output.status, output.stderr.as_str()), (Some(0), ""));
        let text = output.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in expected {
            assert!(text.contains(part), "{arguments:?}: {part:?} is not in {}", output.stdout);
        }
    };
    let commands = ["serve", "demo", "check-config", "view", "segment", "compare", "calibration"];
    check(&[], &commands);
    check(&["serve"], &["--config <FILE>", "--listen <ADDR>", "SIGTERM"]);
    check(&["view"], &["--eye <X,Y,Z>", "nanoseconds is time into the clip", "1280 if absent"]);
    check(&["segment"], &["255 moving, 50 shadow, 0 background", "frames a second were decoded"]);
    check(&["compare"], &["scikit-image", "PSNR is null"]);
    check(&["calibration"], &["pixel centres lie at +0.5"]);
    check(&["check-config"], &["do not make the configuration wrong"]);
    assert_eq!(run(&mut videofields()).status, Some(2));
    assert_eq!(run(videofields().arg("fly")).status, Some(2));
}

#[test]
fn a_result_that_nobody_reads_is_a_failure_and_no_panic() {
    let folder = TempDir::new().unwrap();
    image::RgbImage::new(16, 16).save(folder.path().join("a.png")).unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = videofields();
    command.current_dir(folder.path()).args(["compare", "a.png", "a.png"]);
    let mut child = command.stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("videofields: cannot write to standard output"), "{stderr}");
}
