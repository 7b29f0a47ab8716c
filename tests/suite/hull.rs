//! `videofields hull` from a set of pictures to a mesh that other programs read.

#![expect(clippy::print_stdout, reason = "measured figures are shown with --nocapture")]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use glam::{DMat3, DVec2, DVec3};
use image::{GrayImage, Luma};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;
use videofields_testing::real_data;

const SIDE: u32 = 200;
const FOCAL_PX: f64 = 260.0;

/// What stands in the world: a ball of radius 1 and a smaller one on it.
const BALLS: [(DVec3, f64); 2] = [(DVec3::new(0.2, 0.0, 0.0), 1.0), (DVec3::new(0.2, 0.3, 1.1), 0.5)];

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_videofields")).arg("hull").args(arguments).output().unwrap()
}

fn told(arguments: &[&str]) -> Value {
    let output = run(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Where a camera of the ring stands, and its axes: x right, y down, z forward.
fn pose(i: usize, n: usize) -> (DVec3, DMat3) {
    let angle = std::f64::consts::TAU * i as f64 / n as f64;
    let eye = DVec3::new(4.5 * angle.cos(), 4.5 * angle.sin(), 1.0 + (i % 3) as f64);
    let forward = (DVec3::new(0.2, 0.0, 0.3) - eye).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    (eye, DMat3::from_cols(right, forward.cross(right), forward))
}

/// A set of silhouettes with a cameras' file of a NeRF.
fn make_set(folder: &Path, n: usize) {
    std::fs::create_dir(folder.join("masks")).unwrap();
    let frames = (0..n).map(|i| {
        let (eye, axes) = pose(i, n);
        let mask = GrayImage::from_fn(SIDE, SIDE, |x, y| {
            let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - f64::from(SIDE) / 2.0;
            let direction = (axes * (at / FOCAL_PX).extend(1.0)).normalize();
            let meets = |(centre, radius): &(DVec3, f64)| {
                let along = (*centre - eye).dot(direction);
                (*centre - eye).length_squared() - along * along < radius * radius
            };
            Luma([u8::from(BALLS.iter().any(meets))])
        });
        mask.save(folder.join(format!("masks/shot_{i}.png"))).unwrap();
        // To the right, upwards and backwards.
        let [x, y, z] = [axes.x_axis, -axes.y_axis, -axes.z_axis];
        let row = |of: fn(DVec3) -> f64| [of(x), of(y), of(z), of(eye)];
        json!({
            "file_path": format!("./train/shot_{i}"),
            "transform_matrix": [row(|of| of.x), row(|of| of.y), row(|of| of.z), [0.0, 0.0, 0.0, 1.0]],
        })
    });
    let set = json!({
        "fl_x": FOCAL_PX, "fl_y": FOCAL_PX, "cx": SIDE / 2, "cy": SIDE / 2, "w": SIDE, "h": SIDE,
        "frames": frames.collect::<Vec<_>>(),
    });
    std::fs::write(folder.join("transforms.json"), set.to_string()).unwrap();
}

/// Every edge of a PLY's triangles, each way once; its vertices.
fn check_ply(path: &Path) -> (usize, usize) {
    let mut file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let ply = Parser::<DefaultElement>::new().read_ply(&mut file).unwrap();
    let mut edges: BTreeMap<(i32, i32), u32> = BTreeMap::new();
    for face in &ply.payload["face"] {
        let Some(Property::ListInt(corners)) = face.get("vertex_indices") else { panic!("{face:?}") };
        assert_eq!(corners.len(), 3);
        for i in 0..3 {
            *edges.entry((corners[i], corners[(i + 1) % 3])).or_default() += 1;
        }
    }
    for ((from, to), n) in &edges {
        assert_eq!((*n, edges.get(&(*to, *from))), (1, Some(&1)), "edge {from} {to}");
    }
    (ply.payload["vertex"].len(), ply.payload["face"].len())
}

#[test]
fn a_set_of_silhouettes_becomes_a_closed_mesh_by_either_method() {
    let folder = TempDir::new().unwrap();
    make_set(folder.path(), 14);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (cameras, masks) = (at("transforms.json"), at("masks"));
    let true_m3 = 4.0 / 3.0 * std::f64::consts::PI * 1.0;
    for method in ["image-based", "voxels"] {
        let out = at(&format!("{method}.ply"));
        let given = ["--cameras", &cameras, "--silhouettes", &masks, "--method", method];
        let told = told(&[&given[..], &["--resolution", "96", "--out", &out]].concat());
        let (n_vertices, n_triangles) = check_ply(Path::new(&out));
        assert_eq!((&told["vertices"], &told["triangles"]), (&json!(n_vertices), &json!(n_triangles)));
        let volume = told["volume_m3"].as_f64().unwrap();
        println!("{method}: {volume:.3} for {true_m3:.3} and the smaller one, {n_vertices} vertices");
        // The larger ball, and of the smaller one what stands out; a hull is a little more.
        assert!((true_m3 * 1.03..true_m3 * 1.35).contains(&volume), "{method}: {volume}");
        let corner = |name: &str, axis: usize| told[name][axis].as_f64().unwrap();
        for (axis, [low, high]) in [[-0.8, 1.2], [-1.0, 1.0], [-1.0, 1.6]].into_iter().enumerate() {
            let (low_error, high_error) = (low - corner("low_m", axis), corner("high_m", axis) - high);
            assert!((-0.03..0.35).contains(&low_error), "{method}, low {axis}: {low_error}");
            assert!((-0.03..0.35).contains(&high_error), "{method}, high {axis}: {high_error}");
        }
        for used in told["used"].as_array().unwrap() {
            assert!(used["covered"].as_f64().unwrap() > 0.97, "{used}");
        }
    }
    // Another format of mesh, cameras held back, bounds and a simpler outline.
    let out = at("mesh.glb");
    let given =
        ["--cameras", &cameras, "--silhouettes", &masks, "--hold-back", "./train/shot_3", "--out", &out];
    let more = ["--bounds=-1.2,-1.5,-1.5,1.7,1.5,2", "--simplify-px", "0.5", "--resolution", "64"];
    let told = told(&[&given[..], &more[..]].concat());
    assert_eq!(told["held_back"][0]["camera"], "./train/shot_3");
    assert!(told["held_back"][0]["overlap"].as_f64().unwrap() > 0.93, "{told}");
    let read = gltf::Gltf::open(&out).unwrap();
    assert_eq!((read.meshes().count(), read.blob.is_some()), (1, true));
}

#[test]
fn what_is_wrong_with_a_set_is_told() {
    let folder = TempDir::new().unwrap();
    make_set(folder.path(), 4);
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (cameras, masks, out) = (at("transforms.json"), at("masks"), at("mesh.ply"));
    let usual = ["--cameras", &cameras, "--silhouettes", &masks, "--out", &out];
    let check = |changes: &[&str], part: &str| {
        let output = run(changes);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && told.contains(part), "{changes:?}: {told}");
        assert!(!told.contains("panicked"), "{told}");
    };
    let with = |more: &[&'static str]| [&usual[..], more].concat();
    check(&with(&["--method", "marching"]), "image-based, voxels");
    check(&with(&["--resolution", "4000"]), "1024");
    check(&with(&["--bounds", "0,0,0,1,1"]), "X0,Y0,Z0,X1,Y1,Z1");
    check(&with(&["--bounds", "50,50,50,51,51,51"]), "nothing in common");
    check(&with(&["--hold-back", "shot_9"]), "./train/shot_0");
    check(&with(&["--least-seen", "9"]), "needs 9");
    check(&["--cameras", &cameras, "--silhouettes", &masks, "--out", &at("mesh.stl")], ".ply or .glb");
    check(&["--cameras", &at("none.json"), "--silhouettes", &masks, "--out", &out], "none.json");
    check(&["--cameras", &cameras, "--out", &out], "--silhouettes");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    check(&["--cameras", &cameras, "--silhouettes", &at("empty"), "--out", &out], "0 silhouettes");
    std::fs::write(folder.path().join("masks/shot_1.png"), b"no picture").unwrap();
    check(&usual, "shot_1.png");
    GrayImage::new(SIDE, SIDE).save(folder.path().join("masks/shot_1.png")).unwrap();
    check(&usual, "./train/shot_1: its silhouette is empty");
}

/// The published tight box of Middlebury's dinosaur, metres.
const DINOSAUR: [[f64; 3]; 2] = [[-0.061_897, -0.018_874, -0.057_845], [0.010_897, 0.068_227, 0.015_495]];

#[test]
fn middleburys_dinosaur_is_as_large_as_it_was_published() {
    let Some(set) = real_data("middlebury_dinoSparseRing") else { return };
    let folder = TempDir::new().unwrap();
    let (cameras, images) = (set.join("dinoSR_par.txt"), set.to_str().unwrap().to_owned());
    let out = folder.path().join("dino.ply");
    let given = ["--cameras", cameras.to_str().unwrap(), "--images", &images, "--out", out.to_str().unwrap()];
    let told = told(&[&given[..], &["--hold-back", "dinoSR0003.png,dinoSR0010.png"]].concat());
    check_ply(&out);
    let mut line = String::new();
    for axis in 0..3 {
        let excess_mm = |corner: usize, name: &str, sign: f64| {
            1e3 * sign * (told[name][axis].as_f64().unwrap() - DINOSAUR[corner][axis])
        };
        let (low, high) = (excess_mm(0, "low_m", -1.0), excess_mm(1, "high_m", 1.0));
        write!(line, " {low:.2} {high:.2}").unwrap();
        // From no side can be looked beneath its feet, which no silhouette takes away.
        assert!(if axis == 1 { (0.0..8.0).contains(&low) } else { low.abs() < 1.0 }, "{axis}: {low} mm");
        assert!(high.abs() < 1.0, "{axis}: {high} mm");
    }
    println!("millimetres beyond the published box, low and high of x, y, z:{line}");
    for held in told["held_back"].as_array().unwrap() {
        println!("held back: {held}");
        assert!(held["overlap"].as_f64().unwrap() > 0.97, "{held}");
    }
}

#[test]
fn a_seated_person_is_covered_from_four_cameras() {
    let Some(set) = real_data("utrecht_voxel4") else { return };
    let folder = TempDir::new().unwrap();
    let silhouettes = folder.path().join("silhouettes");
    std::fs::create_dir(&silhouettes).unwrap();
    for camera in ["cam1", "cam2", "cam3", "cam4"] {
        let masks = folder.path().join(camera);
        let segmented = Command::new(env!("CARGO_BIN_EXE_videofields"))
            .args(["segment", "--hold", "--rate-hz", "25", "--frames", "61"])
            .arg("--input")
            .arg(set.join(camera).join("video.avi"))
            .arg("--background")
            .arg(set.join(camera).join("background.avi"))
            .arg("--masks")
            .arg(&masks)
            .output()
            .unwrap();
        assert!(segmented.status.success(), "{}", String::from_utf8_lossy(&segmented.stderr));
        let mut mask = image::open(masks.join("000060.png")).unwrap().into_luma8();
        // Shadows are no part of anybody.
        mask.pixels_mut().for_each(|pixel| pixel.0[0] = if pixel.0[0] == 255 { 255 } else { 0 });
        mask.save(silhouettes.join(format!("{camera}.png"))).unwrap();
    }
    let (cameras, out) = (set.join("calibration_refined.json"), folder.path().join("person.ply"));
    let told = told(&[
        "--cameras",
        cameras.to_str().unwrap(),
        "--silhouettes",
        silhouettes.to_str().unwrap(),
        // In one of them a screen is switched on, too.
        "--largest",
        "--out",
        out.to_str().unwrap(),
    ]);
    check_ply(&out);
    println!(
        "{} litres, from {} to {}",
        1e3 * told["volume_m3"].as_f64().unwrap(),
        told["low_m"],
        told["high_m"]
    );
    for used in told["used"].as_array().unwrap() {
        println!("{used}");
        // A box five times too large left 95.9 % of one.
        assert!(used["covered"].as_f64().unwrap() > 0.975, "{used}");
    }
}
