//! What stands beside ground and boxes: cylinders, footprints, height fields, and models in files made here.

use super::{parse, plaza, with};
use base64::Engine;
use glam::DVec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use videofields_picture::scene::{self, FolderImports, ParsedScene, SceneError};
use videofields_vision::geometry::{Hit, Ray, Shape, SurfaceId};

/// A tetrahedron's corners, y up as glTF has it, with the top at (0, 2, 0).
const POINTS: [[f32; 3]; 4] = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 2.0, 0.0]];
pub(super) const TRIANGLES: [[u16; 3]; 4] = [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]];

pub(super) fn binary() -> Vec<u8> {
    let points = POINTS.iter().flatten().flat_map(|number| number.to_le_bytes());
    points.chain(TRIANGLES.iter().flatten().flat_map(|index| index.to_le_bytes())).collect()
}

/// glTF's JSON over a buffer of [`binary`], the node moved by 10 along x and twice as high.
pub(super) fn gltf(uri: Option<&str>) -> Value {
    let mut buffer = json!({"byteLength": 72});
    if let Some(uri) = uri {
        buffer["uri"] = json!(uri);
    }
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "translation": [10.0, 0.0, 0.0]}, {"mesh": 0, "scale": [1.0, 2.0, 1.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.0, 0.214_041, 1.0]}}],
        "buffers": [buffer],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [-1.0, 0.0, -1.0], "max": [1.0, 2.0, 1.0]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
        ]
    })
}

fn glb() -> Vec<u8> {
    let mut json = gltf(None).to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = binary();
    let mut bytes = b"glTF".to_vec();
    let length = 12 + 8 + json.len() + 8 + binary.len();
    for number in [2, length as u32, json.len() as u32] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(&json);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&binary);
    bytes
}

const PLY: &str = "ply\nformat ascii 1.0\ncomment a coloured square, z up\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n\
    -1 -1 0.5 255 0 0\n1 -1 0.5 255 0 0\n1 1 0.5 0 0 255\n-1 1 0.5 0 0 255\n4 0 1 2 3\n";

/// The same square in binary.
fn binary_ply() -> Vec<u8> {
    let (header, _) = PLY.split_at(PLY.find("end_header").expect("a header"));
    let mut bytes = format!("{}end_header\n", header.replace("ascii", "binary_little_endian")).into_bytes();
    for [x, y, red, blue] in [
        [-1.0, -1.0, 255.0, 0.0],
        [1.0, -1.0, 255.0, 0.0],
        [1.0, 1.0, 0.0, 255.0],
        [-1.0, 1.0, 0.0, 255.0_f32],
    ] {
        [x, y, 0.5].iter().for_each(|number: &f32| bytes.extend(number.to_le_bytes()));
        bytes.extend([red as u8, 0, blue as u8]);
    }
    bytes.push(4);
    [0_i32, 1, 2, 3].iter().for_each(|index| bytes.extend(index.to_le_bytes()));
    bytes
}

/// A scene file's folder with files in it, and a folder beside it that nobody may read from.
pub(super) struct Site(tempfile::TempDir);

impl Site {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir_all(folder.path().join("site/models")).expect("made");
        Self(folder)
    }

    pub(super) fn with(self, file: &str, bytes: impl AsRef<[u8]>) -> Self {
        std::fs::write(self.0.path().join("site").join(file), bytes).expect("written");
        self
    }

    /// The scene with these models.
    pub(super) fn load(&self, models: &Value) -> Result<ParsedScene, SceneError> {
        self.load_document(&json!({"version": 1, "models": models}))
    }

    /// The scene of this document.
    pub(super) fn load_document(&self, document: &Value) -> Result<ParsedScene, SceneError> {
        self.load_text(&document.to_string())
    }

    pub(super) fn load_text(&self, document: &str) -> Result<ParsedScene, SceneError> {
        let path = self.path().join("plaza.json");
        std::fs::write(&path, document).expect("written");
        scene::load_file("plaza", &path, &[])
    }

    /// The scene file's folder.
    pub(super) fn path(&self) -> PathBuf {
        self.0.path().join("site")
    }

    /// The one fault of the scene with this model.
    fn fault(&self, file: &str) -> String {
        let error = self.load(&json!([{"id": "m", "file": file}])).expect_err("a fault");
        let [fault] = error.faults() else { panic!("one fault: {error}") };
        assert_eq!(fault.place, "/models/0/file");
        fault.message.clone()
    }
}

fn down(parsed: &ParsedScene, x: f64, y: f64) -> Option<Hit> {
    parsed.scene.surfaces.hit(&Ray { origin: DVec3::new(x, y, 100.0), direction: -DVec3::Z }, 0.0)
}

#[test]
fn cylinders_footprints_and_height_fields_are_read_and_written_back() {
    let mut document = plaza();
    document["cylinders"] = json!([{"id": "tank", "base_m": [0, 0, 0], "radius_m": 2, "height_m": 5}]);
    document["footprints"] =
        json!([{"id": "house", "polygon": [[8, 8], [12, 8], [12, 12]], "top_m": 6, "color_srgb": "#010203"}]);
    document["height_fields"] = json!([{"id": "hill", "low_m": [-10, -10], "step_m": 4, "columns": 2,
        "heights_m": [1, 1, 3, 3]}]);
    let parsed = parse(&document).expect("a scene");
    for (x, y, surface, height_m, color) in [
        (1.0, 1.0, SurfaceId::Cylinder(0), 5.0, [0xb0, 0xa0, 0x80]),
        (11.5, 9.0, SurfaceId::Footprint(0), 6.0, [1, 2, 3]),
        (-8.0, -8.0, SurfaceId::HeightField(0), 2.0, [0x8a, 0x8a, 0x84]),
    ] {
        let hit = down(&parsed, x, y).expect("a surface");
        assert!(hit.surface == surface && (hit.point_in_world.z - height_m).abs() < 1e-9, "{hit:?}");
        assert_eq!(parsed.scene.material(surface).expect("a material").color_srgb, color);
    }
    assert_eq!(parsed.document.footprints[0].base_m, 0.0);
    let again = scene::parse("plaza", &parsed.document.to_json(), scene::no_imports).expect("its own output");
    assert_eq!(again, parsed);
}

#[test]
fn what_does_not_stand_is_refused_with_its_pointer() {
    let check = |key: &str, value: Value, expected: &str| {
        let error = parse(&with(&format!("/{key}"), json!([value]))).expect_err("a fault");
        let said: Vec<String> = error.faults().iter().map(ToString::to_string).collect();
        assert!(said.len() == 1 && said[0].contains(expected), "expected {expected}, got {said:#?}");
    };
    let tank = |key: &str, value: Value| {
        let mut tank = json!({"id": "tank", "base_m": [0, 0, 0], "radius_m": 2, "height_m": 5});
        tank[key] = value;
        tank
    };
    check("cylinders", tank("radius_m", json!(0)), "/cylinders/0/radius_m: a cylinder needs");
    check("cylinders", tank("height_m", json!(1e9)), "/cylinders/0/height_m: a cylinder needs");
    check("cylinders", tank("base_m", json!([0, 1e9, 0])), "/cylinders/0/base_m: the base must be finite");
    check(
        "cylinders",
        tank("id", json!("hall")),
        "/cylinders/0/id: there is another thing that stands, `hall`",
    );
    check("cylinders", tank("radius", json!(1)), "/cylinders/0/radius: unknown key");
    let house = |key: &str, value: Value| {
        let mut house = json!({"id": "house", "polygon": [[0, 0], [4, 0], [4, 4]], "top_m": 3});
        house[key] = value;
        house
    };
    check("footprints", house("top_m", json!(0)), "/footprints/0/top_m: an extruded footprint's top");
    check("footprints", house("base_m", json!(-1e9)), "/footprints/0/base_m: the height must be finite");
    check(
        "footprints",
        house("polygon", json!([[0, 0], [1, 0]])),
        "/footprints/0/polygon: a ground polygon has 3",
    );
    let crossing = json!([[0, 0], [4, 4], [4, 0], [0, 4]]);
    check(
        "footprints",
        house("polygon", crossing),
        "/footprints/0/polygon/2: the edge from this corner crosses",
    );
    let many: Vec<[f64; 2]> = (0..1025).map(|i| [f64::from(i), f64::from(i * i)]).collect();
    check("footprints", house("polygon", json!(many)), "/footprints/0/polygon: at most 1024 corners");
    let hill = |key: &str, value: Value| {
        let mut hill =
            json!({"id": "hill", "low_m": [0, 0], "step_m": 1, "columns": 2, "heights_m": [0, 0, 0, 0]});
        hill[key] = value;
        hill
    };
    check("height_fields", hill("step_m", json!(0)), "/height_fields/0/step_m: a height field's step");
    check("height_fields", hill("columns", json!(3)), "/height_fields/0/heights_m: a height field has rows");
    check("height_fields", hill("columns", json!(0)), "/height_fields/0/columns: a height field has rows");
    check(
        "height_fields",
        hill("heights_m", json!([0, 0, 0, 1e9])),
        "/height_fields/0/heights_m: a height must",
    );
    check("height_fields", hill("low_m", json!([1e9, 0])), "/height_fields/0/low_m: the south-western post");
    let many = vec![0; (1 << 18) + 1];
    check("height_fields", hill("heights_m", json!(many)), "/height_fields: at most 262144 heights");
    let model = json!({"id": "m", "file": "m.glb"});
    check(
        "models",
        model.clone(),
        "/models/0/file: cannot read \"m.glb\": models and pictures are read only by scene files",
    );
    let with_scale = json!({"id": "m", "file": "m.glb", "scale": 0});
    check("models", with_scale, "/models/0/scale: expected 0.000001 to 1000000 metres");
}

#[test]
fn models_stand_where_the_document_puts_them() {
    let data = format!(
        "data:application/octet-stream;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(binary())
    );
    let site = Site::new()
        .with("a.glb", glb())
        .with("models/b.gltf", gltf(Some("the%20buffer.bin")).to_string())
        .with("models/the buffer.bin", binary())
        .with("c.gltf", gltf(Some(&data)).to_string());
    for file in ["a.glb", "models/b.gltf", "c.gltf", "./models/../a.glb"] {
        // The file's (10, 4, 0) is the top: 5 times as large, turned to the north, moved.
        let models =
            json!([{"id": "m", "file": file, "position_m": [100, 200, 1], "yaw_deg": 90, "scale": 5}]);
        let parsed = site.load(&models).unwrap_or_else(|error| panic!("{file}: {error}"));
        let hit = down(&parsed, 100.0, 250.0).expect("the top");
        assert!((hit.point_in_world - DVec3::new(100.0, 250.0, 21.0)).length() < 1e-4, "{file}: {hit:?}");
        assert_eq!(hit.surface, SurfaceId::Model(0));
        let material = parsed.scene.material(hit.surface).expect("a material");
        assert_eq!(material.part_srgb(hit.part), [255, 0, 127]);
        let Some(Shape::Model(mesh)) = parsed.scene.surfaces.shape(hit.surface) else { panic!("a model") };
        // Seen from outside its triangles turn anticlockwise, for all the turning.
        let middle = mesh.points().iter().copied().sum::<DVec3>() / 4.0;
        for triangle in mesh.triangles() {
            let [a, b, c] = triangle.map(|point| mesh.points()[point as usize]);
            assert!((b - a).cross(c - a).dot(a - middle) > 0.0, "{triangle:?}");
        }
        // What is kept of the document needs the file again, and is the same then.
        let imports = FolderImports::beside(&site.0.path().join("site/plaza.json"), &[]);
        let again = scene::parse("plaza", &parsed.document.to_json(), imports).expect("its own output");
        assert_eq!(again, parsed);
    }
    let mut mirrored = gltf(Some(&data));
    mirrored["nodes"][1]["scale"] = json!([-1.0, 2.0, 1.0]);
    let site = site.with("d.gltf", mirrored.to_string());
    let parsed = site.load(&json!([{"id": "m", "file": "d.gltf", "up": "z"}])).expect("a scene");
    let Some(Shape::Model(mesh)) = parsed.scene.surfaces.shape(SurfaceId::Model(0)) else {
        panic!("a model")
    };
    let middle = mesh.points().iter().copied().sum::<DVec3>() / 4.0;
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|point| mesh.points()[point as usize]);
        assert!((b - a).cross(c - a).dot(a - middle) > 0.0, "mirrored {triangle:?}");
    }
}

#[test]
fn ply_is_read_as_text_and_binary() {
    let site = Site::new().with("a.ply", PLY).with("b.PLY", binary_ply());
    for file in ["a.ply", "b.PLY"] {
        let parsed = site.load(&json!([{"id": "m", "file": file, "scale": 2}])).expect("a scene");
        let [south, north] = [-1.0, 1.0].map(|y| down(&parsed, -y, y).expect("the square"));
        assert!((south.point_in_world.z - 1.0).abs() < 1e-9 && (north.point_in_world.z - 1.0).abs() < 1e-9);
        let material = parsed.scene.material(SurfaceId::Model(0)).expect("a material");
        // Two triangles: each the mean of its corners.
        assert_eq!(
            (material.part_srgb(south.part), material.part_srgb(north.part)),
            ([170, 0, 85], [85, 0, 170])
        );
        assert!(down(&parsed, 2.1, 0.0).is_none());
    }
}

#[test]
fn models_come_only_from_files_beside_the_document() {
    let outside = Site::new().with("x", "");
    let site = Site::new().with("a.glb", glb());
    std::fs::write(site.0.path().join("secret.bin"), binary()).expect("written");
    std::os::unix::fs::symlink(site.0.path().join("secret.bin"), site.0.path().join("site/link.bin"))
        .expect("linked");
    let site = site
        .with("up.gltf", gltf(Some("../secret.bin")).to_string())
        .with("link.gltf", gltf(Some("link.bin")).to_string())
        .with("dots.gltf", gltf(Some("%2e%2e/secret.bin")).to_string())
        .with("root.gltf", gltf(Some("/etc/passwd")).to_string())
        .with("net.gltf", gltf(Some("http://example.org/a.bin")).to_string())
        .with("scheme.gltf", gltf(Some("file:/etc/passwd")).to_string())
        .with("none.gltf", gltf(Some("none.bin")).to_string());
    let neither = "neither beneath the scene file's folder nor beneath a folder of media.roots";
    for (file, expected) in [
        ("up.gltf", neither),
        ("link.gltf", neither),
        ("dots.gltf", neither),
        ("root.gltf", neither),
        ("net.gltf", "/buffers/0/uri: only files beside the model are read"),
        ("scheme.gltf", "/buffers/0/uri: only files beside the model are read"),
        ("none.gltf", "No such file"),
        ("../secret.bin", neither),
        ("", "`file` must be a path"),
        ("a.obj", "No such file"),
        (&outside.0.path().join("site/x").to_string_lossy(), neither),
    ] {
        let said = site.fault(file);
        assert!(said.contains(expected), "{file}: {said}");
    }
    let site = site.with("a.obj", "v 0 0 0").with("models/big.ply", "");
    assert!(site.fault("a.obj").contains("ends with .gltf, .glb or .ply"));
    let big = std::fs::File::create(site.0.path().join("site/models/big.ply")).expect("made");
    big.set_len(scene::MAX_MODEL_BYTES as u64 + 1).expect("a hole");
    assert!(site.fault("models/big.ply").contains("at most 67108864 bytes are allowed"));
}

#[test]
fn counts_are_refused_before_room_is_made_for_them() {
    let edited = |edit: &dyn Fn(&mut Value)| {
        let mut document = gltf(Some("b.bin"));
        edit(&mut document);
        document.to_string()
    };
    let site = Site::new().with("b.bin", binary());
    let check = |file: &str, text: &str, expected: &str| {
        std::fs::write(site.0.path().join("site").join(file), text).expect("written");
        let said = site.fault(file);
        assert!(said.contains(expected), "expected {expected}, got {said}");
    };
    let huge = u64::from(u32::MAX);
    check(
        "a.gltf",
        &edited(&|d| d["accessors"][0]["count"] = json!(huge)),
        "/accessors/0/count: 4294967295, at most",
    );
    check(
        "a.gltf",
        &edited(&|d| d["accessors"][1]["count"] = json!(huge)),
        "/accessors/1/count: 4294967295, at most",
    );
    check(
        "a.gltf",
        &edited(&|d| d["accessors"][1]["count"] = json!(13)),
        "/accessors/1: reaches beyond its buffer",
    );
    check("a.gltf", &edited(&|d| d["accessors"][0]["byteOffset"] = json!(4)), "/accessors/0: reaches beyond");
    check(
        "a.gltf",
        &edited(&|d| d["bufferViews"][1]["byteOffset"] = json!(u64::MAX)),
        "cannot read \"a.gltf\"",
    );
    check(
        "a.gltf",
        &edited(&|d| d["bufferViews"][0]["byteStride"] = json!(252)),
        "reaches beyond its buffer",
    );
    check("a.gltf", &edited(&|d| d["accessors"][0]["componentType"] = json!(5123)), "/accessors/0");
    check("a.gltf", &edited(&|d| d["nodes"][1]["children"] = json!([0])), "one is its own ancestor");
    check(
        "a.gltf",
        &edited(&|d| d["nodes"][0]["children"] = json!(vec![1; 70_000])),
        "/nodes: more than 65536",
    );
    check(
        "a.gltf",
        &edited(&|d| d["scenes"][0]["nodes"] = json!(vec![0; 70_000])),
        "/nodes: more than 65536",
    );
    let stray = "/meshes/0/primitives/0/attributes: names accessor 9 of 2";
    check(
        "a.gltf",
        &edited(&|d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9)),
        stray,
    );
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 1});
    check(
        "a.gltf",
        &edited(&|d| d["meshes"][0]["primitives"] = json!(vec![lines.clone(); 70_000])),
        "/meshes: more than 65536 primitives",
    );
    let ply = |elements: &str| format!("ply\nformat ascii 1.0\n{elements}end_header\n");
    check("a.ply", &ply("element nothing 1048576\n"), "element nothing: 1048576 of them without a property");
    let kinds: String = (0..17).map(|idx| format!("element a{idx} 0\nproperty float x\n")).collect();
    check("a.ply", &ply(&kinds), "at most 16 elements are read, got 17");
    check("a.gltf", &edited(&|d| d["nodes"][0]["translation"][0] = json!(1e30)), "a point must be finite");
    check(
        "a.gltf",
        &edited(&|d| d["meshes"][0]["primitives"][0]["mode"] = json!(1)),
        "at least one triangle",
    );
    check(
        "a.gltf",
        &edited(&|d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        "not glTF 2.0",
    );
    check("a.gltf", &edited(&|d| d["scenes"] = json!([])), "cannot read \"a.gltf\"");
    check("a.gltf", "{}", "not glTF 2.0");
    check("a.gltf", "", "not glTF 2.0");
    let ply = |from: &str, to: &str| PLY.replace(from, to);
    check("a.ply", &ply("element vertex 4", "element vertex 99999999999"), "element vertex: at most");
    check("a.ply", &ply("element face 1", "element face 99999999999"), "triangles, but of 1048576");
    check(
        "a.ply",
        &ply("element face 1", "element other 99999999999\nelement face 1"),
        "element other: at most",
    );
    check("a.ply", &ply("4 0 1 2 3", "4 0 1 2 9"), "face 0 names vertex 9, but there are 4");
    check("a.ply", &ply("4 0 1 2 3", "4 0 1 2 -3"), "face 0: expected at most 256 indices");
    check("a.ply", &ply("-1 -1 0.5", "nan -1 0.5"), "element vertex: Line");
    check("a.ply", &ply("element face 1", "element face 2"), "element face");
    check("a.ply", &ply("4 0 1 2 3", "2 0 1"), "at least one triangle");
    check("a.ply", "ply\nformat ascii 1.0\nend_header\n", "at least one triangle");
    check("a.ply", "", "not a PLY file");
    let mut nan = binary_ply();
    let first = nan.len() - 17 - 4 * 15;
    nan[first..first + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let said = site.with("nan.ply", nan).fault("nan.ply");
    assert!(said.contains("a point must be finite"), "{said}");
}

/// Numbers that follow from a seed (splitmix64).
fn random(state: &mut u64) -> usize {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed ^ (mixed >> 27)) as usize
}

#[test]
fn whatever_is_done_to_a_model_it_is_read_or_refused() {
    let (mut n_read, mut n_refused) = (0, 0);
    for (file, whole) in [("a.glb", glb()), ("a.ply", PLY.as_bytes().to_vec()), ("b.ply", binary_ply())] {
        let site = Site::new();
        for seed in 0..250_u64 {
            let mut state = seed * 7919 + whole.len() as u64;
            let mut bytes = whole.clone();
            match seed % 5 {
                0 => bytes.truncate(random(&mut state) % (whole.len() + 1)),
                1 => {
                    let at = random(&mut state) % bytes.len();
                    bytes.splice(at..at, [0xff, 0xff, 0xff, 0x7f]);
                }
                2 => {
                    let at = random(&mut state) % (bytes.len() - 8);
                    bytes[at..at + 4].copy_from_slice(&[0xff; 4]);
                }
                3 => {
                    // Numbers alone, at the end of every format.
                    let at = bytes.len() - 1 - random(&mut state) % 60;
                    bytes[at] ^= 1 << (random(&mut state) % 3);
                }
                _ => {
                    for _ in 0..=seed % 4 {
                        let at = random(&mut state) % bytes.len();
                        bytes[at] = random(&mut state) as u8;
                    }
                }
            }
            let path = site.0.path().join("site").join(file);
            std::fs::write(Path::new(&path), &bytes).expect("written");
            match site.load(&json!([{"id": "m", "file": file}])) {
                Ok(parsed) => {
                    let bounds = parsed.scene.surfaces.bounds().expect("something");
                    assert!(bounds.iter().all(|corner| corner.is_finite()));
                    n_read += 1;
                }
                Err(error) => {
                    let [fault] = error.faults() else { panic!("{file}, {seed}: {error}") };
                    assert!(fault.place == "/models/0/file" && fault.message.contains(file), "{fault}");
                    assert!(fault.message.len() < 2000, "{fault}");
                    n_refused += 1;
                }
            }
        }
    }
    assert!(n_read > 50 && n_refused > 200, "{n_read} read, {n_refused} refused");
}
