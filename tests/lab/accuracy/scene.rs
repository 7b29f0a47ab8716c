//! A scene without truth, from the command line to the report: the demo's clips are in the repository.

use serde_json::Value;
use std::process::Command;

#[test]
fn a_scene_without_truth_is_measured_by_what_other_cameras_show() {
    if videofields_testing::adapter("").is_none() {
        return;
    }
    let config = videofields_testing::root().join("config/demo/plaza.toml");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    let output = Command::new(env!("CARGO_BIN_EXE_videofields-lab"))
        .args(["accuracy", "--scene", "plaza", "--quick"])
        .arg("--config")
        .arg(config)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report["is_complete"], true);
    let truth = report["subject"]["truth"].as_str().unwrap();
    assert!(truth.starts_with("no truth"), "the report says what it is: {truth}");
    let cameras = report["without_truth"]["cameras"].as_array().unwrap();
    let ids: Vec<_> = cameras.iter().map(|camera| camera["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["west", "east", "north"]);
    for camera in cameras {
        let figure = |part: &str, name: &str| camera[part][name].as_f64().unwrap();
        assert!((0.5..=1.0).contains(&figure("left_out", "seen_share")), "{camera}");
        // The others' pictures of the same ground, from the side: a wrong pose or lens makes less than 20 dB of it.
        assert!(figure("left_out", "psnr_db") > 26.0, "{camera}");
        assert!(figure("held_back", "mean_difference_codes") < 0.5, "{camera}");
        assert!(figure("held_back", "false_share") < 0.005, "{camera}");
    }
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("no truth"), "the page says what it is");
}
