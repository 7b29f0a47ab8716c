//! The scene document as its authors write it: read whole, written back, and refused with places.

#[path = "scene/exchange.rs"]
mod exchange;
#[path = "scene/models.rs"]
mod models;
#[path = "scene/pictures.rs"]
mod pictures;

use glam::DVec3;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;
use videofields_picture::scene::{self, ImportReference, ParsedScene, SceneError, no_imports};
use videofields_testing::real_data;
use videofields_vision::calibrate::Format;
use videofields_vision::error::ErrorKind;
use videofields_vision::geometry::Camera;

fn calibration() -> Value {
    json!({
        "image_size_px": [640, 480],
        "focal_px": [500.0, 500.0],
        "center_px": [320.0, 240.0],
        "distortion": {"model": "brown_conrady", "coefficients": [-0.1, 0.01, 0.0, 0.0]},
        "position_m": [0.0, -20.0, 6.0],
        "world_from_camera": [-0.793_353_34, 0.0, 0.0, 0.608_761_43]
    })
}

/// A document with something of everything.
fn plaza() -> Value {
    json!({
        "version": 1,
        "name": "Plaza",
        "origin": {"latitude_deg": 52.09, "longitude_deg": 5.12, "height_m": 3.0},
        "sky": {"color_srgb": "#102030"},
        "ground": [{"polygon": [[-20, -20], [20, -20], [20, 20], [-20, 20]], "height_m": 0, "color_srgb": "#8a8a84"}],
        "boxes": [{"id": "hall", "center_m": [0, 15, 4], "size_m": [20, 6, 8], "yaw_deg": 90, "color_srgb": "#b0a080"}],
        "cameras": [{"id": "north", "calibration": calibration()}]
    })
}

fn parse(document: &Value) -> Result<ParsedScene, SceneError> {
    scene::parse("plaza", &document.to_string(), no_imports)
}

fn faults_of_text(text: &str) -> Vec<String> {
    let error = scene::parse("plaza", text, no_imports).expect_err("faults");
    assert_eq!(error.kind(), ErrorKind::Invalid);
    error.faults().iter().map(ToString::to_string).collect()
}

/// The plaza with the value at `pointer` exchanged (or put there).
fn with(pointer: &str, value: Value) -> Value {
    let mut document = plaza();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let parent = document.pointer_mut(parent).expect("a parent");
    match parent {
        Value::Array(elements) => {
            let index: usize = key.parse().expect("an index");
            elements.resize_with(elements.len().max(index + 1), || Value::Null);
            elements[index] = value;
        }
        other => other[key] = value,
    }
    document
}

fn without(pointer: &str) -> Value {
    let mut document = plaza();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let parent = document.pointer_mut(parent).and_then(Value::as_object_mut).expect("an object");
    parent.remove(key).expect("it was there");
    document
}

#[test]
fn a_whole_document_is_read() {
    let ParsedScene { scene, document } = parse(&plaza()).expect("a scene");
    assert_eq!(
        (scene.id.as_str(), scene.name.as_str(), scene.sky.plain_srgb()),
        ("plaza", "Plaza", Some([0x10, 0x20, 0x30]))
    );
    assert_eq!(scene.surfaces.ground().next().unwrap().corners().len(), 4);
    assert_eq!(scene.materials[0].color_srgb, [0x8a, 0x8a, 0x84]);
    // Turned by 90 degrees, its own x points north.
    let corner = scene.surfaces.boxes().next().unwrap().world_from_box_point(DVec3::new(10.0, 0.0, 0.0));
    assert!((corner - DVec3::new(0.0, 25.0, 4.0)).length() < 1e-12, "{corner}");
    assert_eq!(scene.materials[1].color_srgb, [0xb0, 0xa0, 0x80]);
    assert_eq!(scene.cameras[0].id.as_str(), "north");
    assert_eq!(scene.cameras[0].camera.size_px(), (640, 480));
    assert_eq!(document.origin.expect("an origin").latitude_deg, 52.09);
}

#[test]
fn what_is_written_back_reads_the_same() {
    for document in [plaza(), json!({"version": 1})] {
        let first = parse(&document).expect("a scene");
        let text = first.document.to_json();
        let second = scene::parse("plaza", &text, no_imports).expect("its own output");
        assert_eq!(second, first);
        assert_eq!(second.document.to_json(), text);
    }
}

#[test]
fn what_is_left_out_has_its_default() {
    let ParsedScene { scene, document } = parse(&json!({"version": 1})).expect("enough");
    assert_eq!((scene.name.as_str(), scene.sky.plain_srgb()), ("plaza", Some([0x87, 0xb5, 0xdd])));
    assert!(
        scene.cameras.is_empty() && scene.surfaces.ground().len() == 0 && scene.surfaces.boxes().len() == 0
    );
    assert_eq!(document.origin, None);
    let parsed = parse(&json!({"version": 1,
        "ground": [{"polygon": [[0, 0], [1, 0], [0, 1]]}],
        "boxes": [{"id": "a", "center_m": [0, 0, 0], "size_m": [1, 1, 1]}]}))
    .expect("enough");
    assert_eq!((parsed.document.ground[0].height_m, parsed.document.boxes[0].yaw_deg), (0.0, 0.0));
    assert_eq!(parsed.scene.materials[0].color_srgb, [0x8a, 0x8a, 0x84]);
}

#[test]
fn every_fault_has_its_pointer() {
    let check = |document: Value, expected: &str| {
        let said = faults_of_text(&document.to_string());
        assert!(said.len() == 1 && said[0].contains(expected), "expected {expected}, got {said:#?}");
    };
    check(without("/version"), "(document): the key `version` is missing");
    check(
        with("/version", json!(2)),
        "/version: expected 1, the only version that this release reads, got 2",
    );
    check(
        with("/version", json!("1")),
        "/version: expected 1, the only version that this release reads, got \"1\"",
    );
    check(with("/name", json!("")), "/name: expected 1 to 200 characters");
    check(with("/name", json!("a\u{1b}[31m")), "/name: expected 1 to 200 characters, none of them a control");
    check(with("/name", json!(7)), "/name: wrong type: integer `7`, expected a string");
    check(
        with("/groud", json!([])),
        "/groud: unknown key `groud`; did you mean `ground`? allowed: version, name",
    );
    check(
        with("/origin/latitude_deg", json!(90.5)),
        "/origin/latitude_deg: expected -90 to 90 degrees, got 90.5",
    );
    check(with("/origin/height", json!(1)), "/origin/height: unknown key `height`; did you mean `height_m`?");
    check(
        with("/entities", json!({"min_size_m": -1})),
        "/entities/min_size_m: expected 0 to 10 metres, got -1",
    );
    check(
        with("/entities", json!({"min_size": 1})),
        "/entities/min_size: unknown key `min_size`; did you mean `min_size_m`?",
    );
    check(
        with("/sky/color_srgb", json!("blue")),
        "/sky/color_srgb: expected a colour such as \"#87b5dd\", got \"blue\"",
    );
    check(with("/ground", json!({})), "/ground: expected a list, got an object");
    check(with("/ground/1", json!(null)), "/ground/1: wrong type: null");
    check(
        with("/ground/0/polygon", json!([[0, 0], [1, 1]])),
        "/ground/0/polygon: a ground polygon has 3 to 4096 corners",
    );
    check(with("/ground/0/polygon/2", json!([0])), "/ground/0/polygon/2: invalid length 1");
    check(
        with("/ground/0/polygon/2/1", json!("x")),
        "/ground/0/polygon/2/1: wrong type: string \"x\", expected a number",
    );
    check(
        with("/ground/0/polygon/2/1", json!(1e9)),
        "/ground/0/polygon: a corner must be finite and within 1e8 m",
    );
    check(
        with("/ground/0/polygon", json!([[0, 0], [4, 4], [4, 0], [0, 4]])),
        "/ground/0/polygon/2: the edge from this corner crosses the edge from corner 0",
    );
    check(
        with("/ground/0/polygon", json!([[0, 0], [4, 0], [4, 4], [0, 0]])),
        "/ground/0/polygon/0: this corner repeats the one before it",
    );
    check(
        with("/ground/0/polygon", json!([[0, 0], [1, 1], [2, 2]])),
        "/ground/0/polygon: a ground polygon needs an area",
    );
    check(with("/ground/0/height_m", json!(1e9)), "/ground/0/height_m: the height must be finite");
    check(with("/boxes/0/size_m/1", json!(0)), "/boxes/0/size_m: a box needs a size of 0.001 m");
    check(with("/boxes/0/center_m/1", json!(-1e9)), "/boxes/0/center_m: the center must be finite");
    check(with("/boxes/0/yaw_deg", json!(361)), "/boxes/0/yaw_deg: expected -360 to 360 degrees, got 361");
    check(with("/boxes/0/id", json!("Hall")), "/boxes/0/id: invalid id \"Hall\"");
    check(with("/boxes/1", plaza()["boxes"][0].clone()), "/boxes/1/id: there is another box `hall`");
    check(
        with("/cameras/1", plaza()["cameras"][0].clone()),
        "/cameras/1/id: there is another camera `north`",
    );
    check(without("/cameras/0/calibration"), "/cameras/0: the key `calibration` is missing");
    check(with("/cameras/0/id", json!("n/s")), "/cameras/0/id: invalid id \"n/s\"");
    let at = |key: &str| format!("/cameras/0/calibration/{key}");
    check(
        with(&at("focal_px"), json!([500, 0])),
        "/cameras/0/calibration/focal_px: focal length must be above 0.001",
    );
    check(
        with(&at("image_size_px/0"), json!(0)),
        "/cameras/0/calibration/image_size_px: image size must be 1 to 65536",
    );
    check(
        with(&at("world_from_camera"), json!([0, 0, 0, 2])),
        "/cameras/0/calibration/world_from_camera: rotation",
    );
    check(
        with(&at("distortion/coefficients"), json!([1, 2, 3])),
        "/cameras/0/calibration/distortion/coefficients: expected 4, 5 or 8 numbers, got 3",
    );
    check(
        with(&at("distortion/model"), json!("fish")),
        "/cameras/0/calibration/distortion/model: unknown value `fish`",
    );
    check(
        with(&at("focal"), json!(1)),
        "/cameras/0/calibration/focal: unknown key `focal`; did you mean `focal_px`?",
    );
    check(json!([]), "(document): expected an object, got a list");
}

#[test]
fn all_faults_are_told_at_once() {
    let mut document = with("/ground/0/polygon/1/0", json!(null));
    document["boxes"][0]["size_m"] = json!([0, 0, 0]);
    document["boxes"][0]["colour"] = json!("#ffffff");
    document["cameras"][0]["calibration"]["position_m"] = json!([1e9, 0, 0]);
    document["nam"] = json!("x");
    let said = faults_of_text(&document.to_string());
    let places: Vec<_> = said.iter().map(|fault| fault.split(':').next().unwrap_or_default()).collect();
    let expected = [
        "/nam",
        "/ground/0/polygon/1/0",
        "/boxes/0/colour",
        "/boxes/0/size_m",
        "/cameras/0/calibration/position_m",
    ];
    assert_eq!(places, expected, "{said:#?}");
}

#[test]
fn text_that_is_not_json_is_refused_with_line_and_column() {
    let check = |text: &str, expected: &str| {
        let said = faults_of_text(text);
        assert!(said[0].contains(expected), "expected {expected}, got {said:?}");
    };
    check("", "line 1, column 0: not JSON: EOF while parsing a value");
    check("{\n \"version\": 1,\n}", "line 3, column 1: not JSON: trailing comma");
    check("{\"version\": 1} x", "line 1, column 16: not JSON: trailing characters");
    for number in ["NaN", "-NaN", "Infinity", "-Infinity", "inf", "1e999", "-1e999"] {
        let text = format!("{{\"version\": 1, \"ground\": [{{\"height_m\": {number}}}]}}");
        check(&text, "JSON has finite numbers only, no NaN and no Infinity");
    }
    check(&"[".repeat(100_000), "recursion limit");
    check("{\"version\": 1, \"name\": \"a\", \"name\": \"b\"}", "/name: this key is written twice");
    check("{\"version\": 1, \"sky\": {\"a/b\": 1, \"a/b\": 2}}", "/sky/a~1b: this key is written twice");
    let lone = "{\"version\": 1, \"name\": \"\\ud800\"}";
    assert!(!faults_of_text(lone).is_empty());
}

#[test]
fn limits_hold() {
    let long =
        scene::parse("plaza", &" ".repeat(scene::MAX_DOCUMENT_BYTES + 1), no_imports).expect_err("too long");
    assert_eq!(long.kind(), ErrorKind::TooLarge);
    let check = |document: Value, expected: &str| {
        let said = faults_of_text(&document.to_string());
        assert!(
            said.iter().any(|fault| fault.contains(expected)),
            "expected {expected}, got {:?}",
            said.first()
        );
    };
    let cameras: Vec<_> =
        (0..257).map(|i| json!({"id": format!("c{i}"), "calibration": calibration()})).collect();
    assert!(parse(&with("/cameras", json!(cameras[..256]))).is_ok());
    check(with("/cameras", json!(cameras)), "/cameras: at most 256 are allowed, got 257");
    let boxes: Vec<_> = (0..4097)
        .map(|i| json!({"id": format!("b{i}"), "center_m": [i, 0, 0], "size_m": [1, 1, 1]}))
        .collect();
    check(with("/boxes", json!(boxes)), "/boxes: at most 4096 are allowed, got 4097");
    let triangle = json!({"polygon": [[0, 0], [1, 0], [0, 1]]});
    check(with("/ground", json!(vec![triangle; 257])), "/ground: at most 256 are allowed, got 257");
    let circle = |n: u32| -> Vec<[f64; 2]> {
        (0..n)
            .map(|i| f64::from(i) / f64::from(n) * std::f64::consts::TAU)
            .map(|a| [a.cos(), a.sin()])
            .collect()
    };
    check(with("/ground", json!([{"polygon": circle(4097)}])), "3 to 4096 corners, got 4097");
    let many = vec![json!({"polygon": circle(1000)}); 17];
    check(
        with("/ground", json!(many)),
        "/ground: at most 16384 corners are allowed in all polygons together",
    );
    let error = scene::parse("No id", &plaza().to_string(), no_imports).expect_err("no id");
    assert!(error.to_string().contains("invalid scene id \"No id\""), "{error}");
    // However many faults there are, a bounded number is told.
    let wrong: Vec<_> = (0..4096).map(|_| json!({"id": 1})).collect();
    assert_eq!(faults_of_text(&with("/boxes", json!(wrong)).to_string()).len(), 64);
}

#[test]
fn imports_are_the_caller_s_choice() {
    let reference = json!({"import": {"file": "View_001.xml", "format": "tsai", "image_size_px": [768, 576],
        "camera": "one", "metres_per_unit": 0.001}});
    let document = with("/cameras/0/calibration", reference);
    let camera: Camera = (*parse(&plaza()).expect("a scene").scene.cameras[0].camera).clone();
    let mut asked = Vec::new();
    let parsed = scene::parse("plaza", &document.to_string(), |reference: &ImportReference| {
        asked.push(reference.clone());
        Ok(camera.clone())
    })
    .expect("a scene");
    let expected = ImportReference {
        file: "View_001.xml".to_owned(),
        format: Some(Format::PetsXml),
        image_size_px: Some([768, 576]),
        camera: Some("one".to_owned()),
        metres_per_unit: Some(0.001),
    };
    assert_eq!(asked, [expected]);
    // What is written back holds the calibration itself and needs no import.
    assert_eq!(scene::parse("plaza", &parsed.document.to_json(), no_imports).expect("a scene"), parsed);

    let check = |document: &Value, expected: &str| {
        let said = faults_of_text(&document.to_string());
        assert!(said.len() == 1 && said[0].starts_with(expected), "expected {expected}, got {said:?}");
    };
    check(&document, "/cameras/0/calibration/import: calibrations are imported only by scene files");
    let at = "/cameras/0/calibration";
    check(&with(at, json!({"import": {}})), "/cameras/0/calibration/import: the key `file` is missing");
    check(
        &with(at, json!({"import": {"file": "a", "fromat": "tsai"}})),
        "/cameras/0/calibration/import/fromat: unknown",
    );
    check(
        &with(at, json!({"import": {"file": "a", "format": "colmap"}})),
        "/cameras/0/calibration/import/format: unknown value `colmap`; allowed: tsai, opencv, json",
    );
    let mut both = calibration();
    both["import"] = json!({"file": "a"});
    let said = faults_of_text(&with(at, both).to_string());
    assert!(
        said.iter().any(|fault| fault.starts_with("/cameras/0/calibration/focal_px: unknown key")),
        "{said:?}"
    );
}

#[test]
fn files_are_imported_only_from_where_they_may_be_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(&path, text).expect("written");
        path
    };
    write("site/north.json", &calibration().to_string());
    write("media/north.json", &calibration().to_string());
    write("secret/north.json", &calibration().to_string());
    write("site/broken.json", "{\"focal_px\": 3, \"world_from_camera\": []}");
    std::os::unix::fs::symlink(folder.path().join("secret"), folder.path().join("site/link"))
        .expect("linked");
    let media = [folder.path().join("media"), folder.path().join("not-there")];
    let load = |file: &str| {
        let document = with("/cameras/0/calibration", json!({"import": {"file": file}}));
        let path = write("site/plaza.json", &document.to_string());
        scene::load_file("plaza", &path, &media)
    };
    let inline = parse(&plaza()).expect("a scene");
    let media_file = folder.path().join("media/north.json");
    for file in [
        "north.json",
        "./north.json",
        "../site/north.json",
        "../media/north.json",
        &media_file.to_string_lossy(),
    ] {
        let imported = load(file).expect("a scene").scene;
        let [a, b] = [&imported, &inline.scene].map(|scene| {
            scene.cameras[0].camera.project(DVec3::new(1.0, 2.0, 0.5)).expect("in front").texture
        });
        assert!((a - b).length() < 1e-12, "{file}: {a} {b}");
    }
    let check = |file: &str, expected: &str| {
        let error = load(file).expect_err("a refusal");
        let [fault] = error.faults() else { panic!("one fault: {error}") };
        assert_eq!(fault.place, "/cameras/0/calibration/import");
        assert!(fault.message.contains(expected), "{file}: {}", fault.message);
    };
    check(
        "../secret/north.json",
        "neither beneath the scene file's folder nor beneath a folder of media.roots",
    );
    check("link/north.json", "neither beneath");
    check("/etc/passwd", "neither beneath");
    check("none.json", "cannot import \"none.json\": No such file");
    check(".", "expected a file, but this is a directory");
    check("", "`file` must be a path");
    check("broken.json", "cannot import \"broken.json\"");
}

#[test]
fn a_scene_file_that_cannot_be_read_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let load = |path: &Path| scene::load_file("plaza", path, &[]).expect_err("a refusal");
    assert_eq!(load(&folder.path().join("none.json")).kind(), ErrorKind::NotFound);
    assert!(load(folder.path()).to_string().contains("this is a directory"));
    let path = folder.path().join("a.json");
    std::fs::write(&path, b"{\"version\": 1, \"name\": \"caf\xe9\"}").expect("written");
    assert!(load(&path).to_string().contains("must be UTF-8, but byte 27 is not"));
    std::fs::write(&path, vec![b' '; scene::MAX_DOCUMENT_BYTES + 1]).expect("written");
    assert_eq!(load(&path).kind(), ErrorKind::TooLarge);
}

#[test]
fn a_real_calibration_is_imported() {
    let Some(folder) = real_data("pets2009_s2l1/calibration") else { return };
    let document = json!({"version": 1, "cameras": [{"id": "view-1", "calibration": {"import": {"file": "View_001.xml"}}}]});
    let own = tempfile::tempdir().expect("a folder");
    let path = own.path().join("pets.json");
    let text = document.to_string().replace("View_001.xml", &folder.join("View_001.xml").to_string_lossy());
    std::fs::write(&path, text).expect("written");
    assert!(scene::load_file("pets", &path, &[]).is_err(), "not beneath the document's folder");
    let parsed = scene::load_file("pets", &path, &[folder]).expect("a scene");
    assert_eq!(parsed.scene.cameras[0].camera.size_px(), (768, 576));
    assert_eq!(scene::parse("pets", &parsed.document.to_json(), no_imports).expect("its own output"), parsed);
}

proptest! {
    #![proptest_config(videofields_testing::seeded(1000))]

    /// Whatever is done to a document's text, the answer is a scene whose numbers are finite, or faults.
    #[test]
    fn no_text_makes_it_panic(
        cut in any::<prop::sample::Index>(),
        length in 0_usize..30,
        put in "(NaN|Infinity|-1|1e999|1e308|1e-320|\"|\\[|\\]|\\{|\\}|,|:|null|true|\u{0}|\u{fc}|[a-z_0-9 .]){0,6}",
    ) {
        let characters: Vec<char> = plaza().to_string().chars().collect();
        let start = cut.index(characters.len());
        let end = (start + length).min(characters.len());
        let text: String = characters[..start].iter().copied()
            .chain(put.chars())
            .chain(characters[end..].iter().copied())
            .collect();
        match scene::parse("plaza", &text, no_imports) {
            Ok(parsed) => {
                let again = scene::parse("plaza", &parsed.document.to_json(), no_imports);
                prop_assert_eq!(again.ok(), Some(parsed));
            }
            Err(error) => prop_assert!(!error.faults().is_empty()),
        }
    }

    /// Numbers of every size, in every place where a number may stand.
    #[test]
    fn no_number_makes_it_panic(place in any::<prop::sample::Index>(), number in any::<f64>()) {
        let document = plaza();
        let mut pointers = Vec::new();
        collect_numbers(&document, String::new(), &mut pointers);
        let pointer = &pointers[place.index(pointers.len())];
        let mutated = with(pointer, json!(number));
        match parse(&mutated) {
            Ok(parsed) => prop_assert!(parsed.scene.surfaces.boxes().all(|b| b.center().is_finite())),
            Err(error) => prop_assert!(!error.faults().is_empty()),
        }
    }
}

fn collect_numbers(value: &Value, pointer: String, pointers: &mut Vec<String>) {
    match value {
        Value::Number(_) => pointers.push(pointer),
        Value::Array(elements) => {
            for (i, element) in elements.iter().enumerate() {
                collect_numbers(element, format!("{pointer}/{i}"), pointers);
            }
        }
        Value::Object(fields) => {
            for (key, field) in fields {
                collect_numbers(field, format!("{pointer}/{key}"), pointers);
            }
        }
        _ => {}
    }
}
