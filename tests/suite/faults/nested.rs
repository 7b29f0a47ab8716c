//! Documents that are nested a hundred thousand deep, or in which a short text stands for a huge one: refused in every format
//! that is read, on the stack that a thread of the daemon has.

use std::path::Path;
use videofields_picture::scene;
use videofields_service::wall::Wall;
use videofields_vision::calibrate::{self, ImportOptions};
use videofields_vision::config;

const DEPTH: usize = 100_000;

fn nested(open: &str, close: &str, within: &str) -> String {
    [open.repeat(DEPTH).as_str(), within, &close.repeat(DEPTH)].concat()
}

fn calibration(text: &str) -> String {
    calibrate::import(text, None, &ImportOptions::default()).expect_err("a refusal").to_string()
}

#[test]
fn calibrations_nested_a_hundred_thousand_deep_are_refused() {
    let in_json = nested("[", "]", "1");
    let in_object = nested("{\"K\":", "}", "1");
    let in_xml = nested("<a>", "</a>", "1");
    let deep = [
        in_json.clone(),
        in_object,
        format!("{{\"world_from_camera\": {in_json}}}"),
        format!("%YAML:1.0\n---\nK: {in_json}\n"),
        format!("%YAML:1.0\n---\nK: {}\n", nested("{a: ", "}", "1")),
        format!("%YAML:1.0\n---\nK:\n{}", (1..2000).map(|at| " ".repeat(at) + "- \n").collect::<String>()),
        format!("<?xml version=\"1.0\"?><opencv_storage>{in_xml}</opencv_storage>"),
        format!("<Camera><Intrinsic>{in_xml}</Intrinsic><Extrinsic/></Camera>"),
        // It never ends.
        "<opencv_storage>".to_owned() + &"<a>".repeat(DEPTH),
        "{\"K\":".repeat(DEPTH),
    ];
    for text in deep {
        let said = calibration(&text);
        assert!(said.len() < 1000, "{said}");
    }
}

#[test]
fn a_short_calibration_that_stands_for_a_huge_one_is_refused() {
    let mut entities = String::from("<!ENTITY a0 \"0123456789\">");
    let mut anchors = String::from("a0: &a0 [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]\n");
    for level in 1..12 {
        let before = level - 1;
        entities += &format!("<!ENTITY a{level} \"{}\">", format!("&a{before};").repeat(10));
        let listed = vec![format!("*a{before}"); 10].join(", ");
        anchors += &format!("a{level}: &a{level} [{listed}]\n");
    }
    let xml = format!(
        "<?xml version=\"1.0\"?><!DOCTYPE opencv_storage [{entities}]><opencv_storage><K>&a11;</K></opencv_storage>"
    );
    calibration(&xml);
    let foreign = "<?xml version=\"1.0\"?><!DOCTYPE o [<!ENTITY x SYSTEM \"file:///etc/passwd\">]>\
                   <opencv_storage><K>&x;</K></opencv_storage>";
    let said = calibration(foreign);
    assert!(!said.contains("root:"), "{said}");
    let said = calibration(&format!("%YAML:1.0\n---\n{anchors}K: *a11\n"));
    assert!(said.contains("alias") || said.contains("anchor"), "{said}");
}

#[test]
fn scenes_walls_and_configurations_nested_a_hundred_thousand_deep_are_refused() {
    for within in [nested("[", "]", "1"), nested("{\"a\":", "}", "1"), "[".repeat(DEPTH)] {
        for text in [within.clone(), format!("{{\"version\": 1, \"boxes\": {within}}}")] {
            let error = scene::parse("deep", &text, scene::no_imports).expect_err("a refusal");
            assert!(error.to_string().contains("recursion limit"), "{error}");
            // Bodies of requests are read in this way.
            let read: Result<serde_json::Value, _> = serde_json::from_str(&text);
            assert!(read.expect_err("a refusal").to_string().contains("recursion limit"));
        }
    }
    // As deep as a body may be, a wall is refused at its place.
    let deepest = [vec!["["; 100].concat(), vec!["]"; 100].concat()].concat();
    let wall = serde_json::from_str(&format!("{{\"surface\": {deepest}}}")).expect("within the limit");
    assert!(Wall::read(wall).is_err());

    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("deep.toml");
    let read = |path: &Path, text: &str| {
        std::fs::write(path, text).expect("written");
        config::load(path).expect_err("a refusal").to_string()
    };
    let tables = vec!["a"; DEPTH].join(".");
    for text in [
        format!("a = {}\n", nested("[", "]", "1")),
        format!("a = {}\n", nested("{a=", "}", "1")),
        format!("{tables} = 1\n"),
        format!("[{tables}]\n"),
    ] {
        let said = read(&path, &text);
        assert!(said.len() < 20_000, "{} bytes", said.len());
    }
}
