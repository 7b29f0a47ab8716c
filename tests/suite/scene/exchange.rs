//! Scenes in and out of other programs: the paper's JSON and glTF.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use videofields_picture::scene::exchange::{self, ExchangeFormat, MAX_EXCHANGE_BYTES, Taken};
use videofields_picture::scene::{self, FolderImports, ParsedScene, SceneError};
use videofields_simulate::World;

const GLTF: [ExchangeFormat; 2] = [ExchangeFormat::Gltf, ExchangeFormat::Glb];

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A scene with everything that needs no file.
fn everything() -> ParsedScene {
    let document = json!({
        "version": 1,
        "name": "Everything",
        "origin": {"latitude_deg": 52.09, "longitude_deg": 5.12, "height_m": 3.0},
        "sky": {"gradient": {"zenith_srgb": "#3a6fb0", "horizon_srgb": "#cfdde8", "ground_srgb": "#6b665c"}},
        "ground": [
            {"polygon": [[-20.25, -20.1], [20, -20], [20, 20], [0, 3], [-20, 20]], "height_m": 0.125, "color_srgb": "#102030"},
            {"polygon": [[500_000.123_456_789, 5_800_000.5], [500_010.3, 5_800_000.5], [500_005.1, 5_800_009.7]], "height_m": -3},
        ],
        "boxes": [
            {"id": "hall", "center_m": [0, 15, 4], "size_m": [20, 6, 8], "yaw_deg": 270, "color_srgb": "#b0a080"},
            {"id": "hut", "center_m": [3.3, -5.7, 1.1], "size_m": [2.1, 3.2, 2.2], "yaw_deg": -33.3},
        ],
        "cylinders": [{"id": "tank", "base_m": [-8, 5, 0.2], "radius_m": 2.3, "height_m": 5.1}],
        "footprints": [{"id": "church", "polygon": [[2.5, 2], [9, 2], [9, 5], [5, 5], [5, 9], [2, 9]], "base_m": 0.3, "top_m": 6.1}],
        "height_fields": [{"id": "hill", "low_m": [30.5, -4], "step_m": 1.5, "columns": 3,
            "heights_m": [0, 0.1, 0.2, 0.3, 1.4, 0.5, 0, 0.7, 0]}],
        "entities": {"min_size_m": 0.4},
        "cameras": [
            {"id": "pinhole", "calibration": {"image_size_px": [640, 480], "focal_px": [500.5, 510.25],
                "center_px": [321.5, 236.75], "position_m": [500_003.3, 5_799_990.7, 6.5],
                "world_from_camera": [-0.793_353_34, 0.0, 0.0, 0.608_761_43]}},
            {"id": "lens", "calibration": {"image_size_px": [1920, 1080], "focal_px": [900, 901], "center_px": [960, 540],
                "distortion": {"model": "brown_conrady", "coefficients": [-0.1, 0.01, 0.001, -0.002, 0.0003]},
                "position_m": [0.0, -20.0, 6.0], "world_from_camera": [0.7, 0.1, -0.3, 0.640_312_423_743_285]}},
            {"id": "fish", "calibration": {"image_size_px": [1000, 1000], "focal_px": [320, 320], "center_px": [500, 500],
                "distortion": {"model": "fisheye", "coefficients": [0.01, 0.0, 0.0, 0.0]},
                "position_m": [1, 2, 9], "world_from_camera": [1, 0, 0, 0]}},
        ],
        "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0], "fov_deg": 40},
    });
    scene::parse("everything", &document.to_string(), scene::no_imports).unwrap()
}

/// The scenes of this project: the demo's, those of recordings, and those of the simulator's worlds.
fn scenes() -> Vec<(String, ParsedScene, FolderImports)> {
    let mut scenes =
        vec![("everything".to_owned(), everything(), FolderImports::beneath(Path::new("."), &[]))];
    let file = root("config/demo/plaza.json");
    scenes.push((
        "demo".into(),
        scene::load_file("plaza", &file, &[]).unwrap(),
        FolderImports::beside(&file, &[]),
    ));
    for (id, _) in World::catalogue().into_iter().filter(|(id, _)| !id.starts_with("effect-")) {
        let text = World::named(&id).unwrap().scene_json(None).unwrap();
        let imports = FolderImports::beneath(&root("config/worlds"), &[]);
        let parsed =
            scene::parse(&id, &text, imports.clone()).unwrap_or_else(|error| panic!("{id}: {error}"));
        scenes.push((id, parsed, imports));
    }
    scenes
}

/// Whether two documents say the same within 1e-9 of every number; a quaternion and its opposite are the same.
fn same(a: &Value, b: &Value, place: &str) {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= 1e-9, "{place}: {a} or {b}");
        }
        (Value::Array(a_all), Value::Array(b_all)) => {
            assert_eq!(a_all.len(), b_all.len(), "{place}");
            if place.ends_with("/world_from_camera") {
                let numbers = |of: &[Value]| of.iter().map(|of| of.as_f64().unwrap()).collect::<Vec<_>>();
                let (a, b) = (numbers(a_all), numbers(b_all));
                let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
                let off = a.iter().zip(&b).map(|(a, b)| (a - b * dot.signum()).abs()).fold(0.0, f64::max);
                assert!(off <= 1e-9, "{place}: {a:?} or {b:?}");
                return;
            }
            a_all
                .iter()
                .zip(b_all)
                .enumerate()
                .for_each(|(idx, (a, b))| same(a, b, &format!("{place}/{idx}")));
        }
        (Value::Object(a_all), Value::Object(b_all)) => {
            let names = |of: &serde_json::Map<String, Value>| of.keys().cloned().collect::<Vec<_>>();
            assert_eq!(names(a_all), names(b_all), "{place}");
            a_all.iter().for_each(|(name, a)| same(a, &b_all[name], &format!("{place}/{name}")));
        }
        (a, b) => assert_eq!(a, b, "{place}"),
    }
}

fn document(parsed: &ParsedScene) -> Value {
    serde_json::from_str(&parsed.document.to_json()).unwrap()
}

fn take(bytes: &[u8], format: ExchangeFormat) -> Taken {
    exchange::take(bytes, format).unwrap_or_else(|error| panic!("{format}: {error}"))
}

#[test]
fn every_scene_comes_back_from_gltf_as_it_was() {
    for (id, parsed, imports) in scenes() {
        for format in GLTF {
            let written = exchange::write(&parsed.scene, format).unwrap();
            let taken = take(&written.bytes, format);
            assert_eq!(taken.warnings, [], "{id} {format}");
            let again = scene::parse(&parsed.scene.id, &taken.document, imports.clone());
            let again = again.unwrap_or_else(|error| panic!("{id} {format}: {error}"));
            same(&document(&parsed), &document(&again), &format!("{id} {format} "));
        }
    }
}

#[test]
fn every_scene_comes_back_from_the_papers_json_but_for_what_is_told() {
    for (id, parsed, imports) in scenes() {
        let written = exchange::write(&parsed.scene, ExchangeFormat::Paper).unwrap();
        let taken = take(&written.bytes, ExchangeFormat::Paper);
        let again = scene::parse(&parsed.scene.id, &taken.document, imports).unwrap();
        let (mut was, mut is) = (document(&parsed), document(&again));
        // What was told to be lost, and nothing else, is taken out of both.
        for warning in &written.warnings {
            for of in [&mut was, &mut is] {
                let (parent, key) = warning.place.rsplit_once('/').unwrap();
                if let Some(Value::Object(parent)) = of.pointer_mut(parent) {
                    parent.remove(key);
                }
            }
        }
        for of in [&mut was, &mut is] {
            // A turn of 270 degrees is one of -90.
            for solid in of["boxes"].as_array_mut().unwrap() {
                let yaw = solid["yaw_deg"].as_f64().unwrap();
                let (sin, cos) = yaw.to_radians().sin_cos();
                solid["yaw_deg"] = json!([sin, cos]);
            }
        }
        same(&was, &is, &format!("{id} "));
        let file: Value = serde_json::from_slice(&written.bytes).unwrap();
        assert_eq!(
            file["warnings"].as_array().unwrap().len(),
            written.warnings.len(),
            "{id}: told in the file too"
        );
        if id == "everything" {
            let told: Vec<_> = written.warnings.iter().map(|of| of.place.as_str()).collect();
            assert_eq!(
                told,
                [
                    "/origin",
                    "/view",
                    "/height_fields",
                    "/sky",
                    "/entities/min_size_m",
                    "/cameras/0/calibration/center_px",
                    "/cameras/1/calibration/distortion",
                    "/cameras/2/calibration/distortion",
                ]
            );
        }
    }
}

/// The JSON of a GLB and its buffer, by nothing of the project's; it must be valid for the `gltf` crate too.
fn unpacked(glb: &[u8]) -> (Value, &[u8]) {
    gltf::Gltf::from_slice(glb).expect("valid glTF 2.0");
    let n_json = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&glb[20..20 + n_json]).unwrap(), &glb[28 + n_json..])
}

fn numbers<const N: usize>(of: &Value, default: [f64; N]) -> [f64; N] {
    of.as_array().map_or(default, |all| std::array::from_fn(|idx| all[idx].as_f64().unwrap()))
}

/// World points of a node's mesh, y up.
fn world_points(file: &Value, buffer: &[u8], node: &Value) -> Vec<DVec3> {
    let primitive = &file["meshes"][node["mesh"].as_u64().unwrap() as usize]["primitives"][0];
    let words = |accessor: &Value| {
        let accessor = &file["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &file["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let bytes = &buffer[start..start + view["byteLength"].as_u64().unwrap() as usize];
        let (words, rest) = bytes.as_chunks::<4>();
        assert!(rest.is_empty());
        words.to_vec()
    };
    let positions: Vec<f64> = words(&primitive["attributes"]["POSITION"])
        .into_iter()
        .map(|word| f32::from_le_bytes(word).into())
        .collect();
    let rotation = DQuat::from_array(numbers(&node["rotation"], [0.0, 0.0, 0.0, 1.0]));
    let translation = DVec3::from_array(numbers(&node["translation"], [0.0; 3]));
    let place = |word: [u8; 4]| {
        let at = 3 * u32::from_le_bytes(word) as usize;
        rotation * DVec3::new(positions[at], positions[at + 1], positions[at + 2]) + translation
    };
    words(&primitive["indices"]).into_iter().map(place).collect()
}

#[test]
fn another_reader_finds_cameras_and_surfaces_where_they_stand() {
    let parsed = scene::load_file("plaza", &root("config/demo/plaza.json"), &[]).unwrap();
    let bytes = exchange::write(&parsed.scene, ExchangeFormat::Glb).unwrap().bytes;
    let (file, buffer) = unpacked(&bytes);
    let nodes = file["nodes"].as_array().unwrap();
    let meshes: Vec<&Value> = nodes.iter().filter(|node| node["mesh"].is_u64()).collect();
    assert_eq!(meshes.len(), 11, "five of ground, six boxes");
    // y is up and z is south.
    let z_up = |point: DVec3| DVec3::new(point.x, -point.z, point.y);
    for (node, (_, shape)) in meshes.iter().zip(parsed.scene.surfaces.named()) {
        let (low, high) = shape.bounds();
        let points = world_points(&file, buffer, node);
        let found_low = points.iter().copied().map(z_up).reduce(DVec3::min).unwrap();
        let found_high = points.iter().copied().map(z_up).reduce(DVec3::max).unwrap();
        assert!(
            found_low.distance(low) < 1e-5 && found_high.distance(high) < 1e-5,
            "{node}: {found_low} {low}"
        );
    }
    let cameras: Vec<&Value> = nodes.iter().filter(|node| node["camera"].is_u64()).collect();
    assert_eq!(cameras.len(), 3);
    for (node, member) in cameras.iter().zip(&parsed.scene.cameras) {
        assert_eq!(node["name"], member.id.as_str());
        let lens = &file["cameras"][node["camera"].as_u64().unwrap() as usize]["perspective"];
        let own = &member.camera;
        let (width, height) = own.size_px();
        let yfov = 2.0 * (0.5 * f64::from(height) / own.focal_px().y).atan();
        assert!((lens["yfov"].as_f64().unwrap() - yfov).abs() < 1e-12, "{}", member.id);
        let aspect = f64::from(width) / f64::from(height);
        assert!((lens["aspectRatio"].as_f64().unwrap() - aspect).abs() < 1e-12, "{}", member.id);
        // What lies along the node's -z is in the middle of the picture, and what lies along its y above that.
        let rotation = DQuat::from_array(numbers(&node["rotation"], [0.0, 0.0, 0.0, 1.0]));
        let translation = DVec3::from_array(numbers(&node["translation"], [0.0; 3]));
        let seen = |own_point: DVec3| own.project(z_up(rotation * own_point + translation)).unwrap().texture;
        let middle = glam::DVec2::splat(0.5);
        assert!((seen(DVec3::new(0.0, 0.0, -10.0)) - middle).length() < 1e-12, "{}", member.id);
        let (above, right) = (seen(DVec3::new(0.0, 1.0, -10.0)), seen(DVec3::new(1.0, 0.0, -10.0)));
        assert!(above.y < 0.45 && right.x > 0.52, "{}: {above} {right}", member.id);
    }
}

#[test]
fn what_other_programs_change_is_taken() {
    let parsed = everything();
    let bytes = exchange::write(&parsed.scene, ExchangeFormat::Gltf).unwrap().bytes;
    let mut file: Value = serde_json::from_slice(&bytes).unwrap();
    let node = |file: &Value, name: &str| {
        let nodes = file["nodes"].as_array().unwrap();
        nodes.iter().position(|node| node["name"] == name).unwrap()
    };
    let (hut, pinhole) = (node(&file, "hut"), node(&file, "pinhole"));
    // Moved up by half a metre, turned, and made twice as long; beneath a parent that is moved east.
    file["nodes"][hut]["translation"][1] = json!(1.6);
    file["nodes"][hut]["rotation"] = json!([0, 0.0, 0, 1]);
    file["nodes"][hut]["scale"] = json!([2, 1, 1]);
    let parent = file["nodes"].as_array().unwrap().len();
    file["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!({"name": "group", "children": [hut], "translation": [100, 0, 0]}));
    let roots = file["scenes"][0]["nodes"].as_array_mut().unwrap();
    roots.retain(|root| root != hut);
    roots.push(json!(parent));
    // Another lens.
    let camera = file["nodes"][pinhole]["camera"].as_u64().unwrap() as usize;
    file["cameras"][camera]["perspective"]["yfov"] = json!(1.0);
    // A camera and a mesh of nobody's.
    let next = file["nodes"].as_array().unwrap().len();
    file["cameras"]
        .as_array_mut()
        .unwrap()
        .push(json!({"type": "perspective", "perspective": {"yfov": 0.9, "aspectRatio": 1.5, "znear": 0.1}}));
    let foreign = file["cameras"].as_array().unwrap().len() - 1;
    file["nodes"].as_array_mut().unwrap().extend([
        json!({"name": "blender", "camera": foreign, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}),
        json!({"name": "monkey", "mesh": 0}),
    ]);
    file["scenes"][0]["nodes"].as_array_mut().unwrap().extend([json!(next), json!(next + 1)]);
    let taken = take(file.to_string().as_bytes(), ExchangeFormat::Gltf);
    let told: Vec<_> = taken.warnings.iter().map(|of| of.place.clone()).collect();
    assert_eq!(
        told,
        [
            format!("/cameras/{camera}/perspective/yfov"),
            format!("/cameras/{foreign}"),
            format!("/nodes/{}/mesh", next + 1)
        ]
    );
    let again = scene::parse("everything", &taken.document, scene::no_imports).unwrap();
    let hut = again.document.boxes.iter().find(|of| of.id == "hut").unwrap();
    assert_eq!(hut.size_m, [4.2, 3.2, 2.2]);
    assert!(
        DVec3::from(hut.center_m).distance(DVec3::new(103.3, -5.7, 1.6)) < 1e-9 && hut.yaw_deg.abs() < 1e-9
    );
    let camera = |id: &str| &again.scene.cameras.iter().find(|of| of.id.as_str() == id).unwrap().camera;
    assert!((camera("pinhole").focal_px().y - 240.0 / 0.5_f64.tan()).abs() < 1e-9);
    let blender = camera("blender");
    assert_eq!(blender.size_px(), (1620, 1080));
    assert!(blender.pose().position_in_world.distance(DVec3::new(1.0, -3.0, 2.0)) < 1e-12);
    assert!(blender.pose().forward_in_world().distance(DVec3::Y) < 1e-12, "-z is north");
}

/// A file that is as small as one can be.
fn small() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0], "extras": {"videofields": {"version": 1}}}],
        "nodes": [{"name": "a", "camera": 0, "translation": [0, 5, 0]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        "buffers": [{"byteLength": 12, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAA"}],
        "bufferViews": [{"buffer": 0, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}]
    })
}

#[test]
fn files_that_claim_what_they_have_not_are_refused_at_their_place() {
    take(small().to_string().as_bytes(), ExchangeFormat::Gltf);
    let check = |pointer: &str, value: Value, place: &str, message: &str| {
        let mut file = small();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match file.pointer_mut(parent).unwrap() {
            Value::Array(all) => all[key.parse::<usize>().unwrap()] = value,
            parent => parent[key] = value,
        }
        let error = exchange::take(file.to_string().as_bytes(), ExchangeFormat::Gltf)
            .map_err(|error| (error.to_string(), error.faults().to_vec()))
            .and_then(|taken| {
                let read = scene::parse("a", &taken.document, scene::no_imports);
                read.map_err(|error| (error.to_string(), taken.told(error.faults().to_vec())))
            });
        let Err((said, faults)) = error else { panic!("{pointer} is taken") };
        let found = faults.iter().any(|fault| fault.place == place && fault.message.contains(message));
        assert!(found, "{pointer}: {said} {faults:?}");
    };
    let long = "A".repeat(4000);
    check("/asset/version", json!("1.0"), "/asset/version", "2.0");
    check("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "/extensionsRequired/0", "not read");
    check("/accessors/0/count", json!(2_147_483_648_u64), "/accessors/0/count", "expected 1 to");
    check("/accessors/0/count", json!(2), "/accessors/0/count", "beyond their view");
    check("/accessors/0/count", json!(-1), "/accessors/0/count", "whole number");
    check("/accessors/0/count", json!(0), "/accessors/0/count", "expected 1 to");
    check("/accessors/0/byteOffset", json!(u64::MAX), "/accessors/0/count", "beyond");
    check("/accessors/0/bufferView", json!(7), "/accessors/0/bufferView", "one of the 1");
    check("/accessors/0/sparse", json!({"count": 1_000_000_000}), "/accessors/0/sparse", "not read");
    check("/accessors/0/componentType", json!(1), "/accessors/0/componentType", "5126");
    check("/bufferViews/0/byteLength", json!(u64::MAX), "/bufferViews/0/byteLength", "beyond");
    check("/buffers/0/byteLength", json!(4_294_967_295_u64), "/buffers/0/byteLength", "claims");
    for uri in
        ["file:///etc/passwd", "http://169.254.169.254/", "../../secret.bin", "buffer.bin", "", "data:,AAAA"]
    {
        let said = if uri.starts_with("data:") { "base64" } else { "file itself" };
        check("/buffers/0/uri", json!(uri), "/buffers/0/uri", said);
        check("/images", json!([{"uri": uri}]), "/images/0/uri", said);
    }
    check(
        "/buffers/0/uri",
        json!(format!("data:x;base64,{}", &long[..4])),
        "/buffers/0/byteLength",
        "there are 3",
    );
    check(
        "/meshes/0/primitives/0/indices",
        json!(2_147_483_648_u64),
        "/meshes/0/primitives/0/indices",
        "one of",
    );
    check(
        "/meshes/0/primitives/0/attributes/POSITION",
        json!(9),
        "/meshes/0/primitives/0/attributes/POSITION",
        "one of",
    );
    check("/scene", json!(1), "/scene", "one of the 1");
    check("/scenes/0/nodes", json!([0, 0]), "/nodes/0", "twice");
    check("/scenes/0/nodes", json!([4]), "/nodes", "node 4");
    check("/nodes/0/children", json!([0]), "/nodes/0", "ancestor");
    check("/nodes/0/camera", json!(3), "/nodes/0/camera", "one of the 1");
    check("/nodes/0/translation", json!([0, 5]), "/nodes/0/translation", "");
    check("/nodes/0/translation", json!([0, "5", 0]), "/nodes/0/translation/1", "expected a number");
    check("/nodes/0/translation", json!([0, 1e300, 0]), "/nodes/0", "position");
    check("/nodes/0/rotation", json!([0, 0, 0, 0]), "/nodes/0/rotation", "unit quaternion");
    check("/nodes/0/scale", json!([1, -1, 1]), "/nodes/0", "mirrors");
    check("/nodes/0/scale", json!([1, 0, 1]), "/nodes/0", "lengths");
    check(
        "/nodes/0/matrix",
        json!([1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "/nodes/0",
        "column-major",
    );
    check("/nodes/0/name", json!("No id!"), "/nodes/0", "id");
    check(
        "/nodes/0/extras",
        json!({"videofields": {"kind": "tree"}}),
        "/nodes/0/extras/videofields/kind",
        "camera",
    );
    check(
        "/nodes/0/extras",
        json!({"videofields": {"kind": "box", "id": "b"}}),
        "/nodes/0/extras/videofields",
        "size_m",
    );
    check("/cameras/0/perspective/yfov", json!(3.2), "/cameras/0/perspective/yfov", "less than pi");
    check("/scenes/0/extras/videofields/sky", json!(3), "/scenes/0/extras/videofields/sky", "");
    check(
        "/scenes/0/extras/videofields/version",
        json!(2),
        "/scenes/0/extras/videofields/version",
        "expected 1",
    );
}

#[test]
fn texts_that_are_no_gltf_are_refused_before_they_grow() {
    let refused = |bytes: &[u8], format| match exchange::take(bytes, format).unwrap_err() {
        SceneError::Faults(faults) => faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
        error => error.to_string(),
    };
    let number = |number: &str| small().to_string().replacen("\"yfov\":1", &format!("\"yfov\":{number}"), 1);
    for bad in ["NaN", "Infinity", "-Infinity", "1e999"] {
        let said = refused(number(bad).as_bytes(), ExchangeFormat::Gltf);
        assert!(said.contains("no NaN and no Infinity"), "{bad}: {said}");
    }
    assert!(refused(number("1,\"yfov\":2").as_bytes(), ExchangeFormat::Gltf).contains("written twice"));
    let deep = "[".repeat(100_000);
    assert!(refused(deep.as_bytes(), ExchangeFormat::Gltf).contains("recursion limit"));
    let wide = format!("[{}0]", "0,".repeat(3_000_000));
    assert!(refused(wide.as_bytes(), ExchangeFormat::Gltf).contains("values"));
    assert!(refused(b"\xff\xfe{}", ExchangeFormat::Gltf).contains("UTF-8"));
    assert!(refused(b"", ExchangeFormat::Gltf).contains("not JSON"));
    assert!(refused(&vec![b' '; MAX_EXCHANGE_BYTES + 1], ExchangeFormat::Gltf).contains("bytes"));

    let glb = exchange::write(&everything().scene, ExchangeFormat::Glb).unwrap().bytes;
    take(&glb, ExchangeFormat::Glb);
    for cut in [0, 3, 11, 12, 19, 20, 100, glb.len() - 1] {
        refused(&glb[..cut], ExchangeFormat::Glb);
        // Also where the file says that it is as long.
        let mut shorter = glb[..cut].to_vec();
        if cut >= 12 {
            shorter[8..12].copy_from_slice(&(cut as u32).to_le_bytes());
            refused(&shorter, ExchangeFormat::Glb);
        }
    }
    for at in [0, 4, 8, 12, 16] {
        let mut changed = glb.clone();
        changed[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        refused(&changed, ExchangeFormat::Glb);
    }
}
