//! The mapping room seen from outside: real calibrations, and an inverse of Tsai's model written apart.
#![expect(clippy::print_stdout, reason = "measured figures are shown with --nocapture")]

use glam::{DVec2, DVec3};
use std::path::Path;
use std::time::Instant;
use videofields_testing::real_data;
use videofields_vision::calibrate::{ImportOptions, import};
use videofields_vision::geometry::{Camera, GroundPolygon, OrientedBox, Surfaces};
use videofields_vision::mapping::{Builder, GridSettings, WorldMap, locate};

/// Farthest from the camera that ground points are compared, metres.
const FAR_M: f64 = 40.0;

/// Tsai's model as its paper has it, read and inverted without the importer and the camera under test: millimetres,
/// pixel centres at integers, matrices by hand.
struct Tsai {
    numbers: std::collections::HashMap<String, f64>,
}

impl Tsai {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).expect("a readable calibration");
        let words = text.split_whitespace().filter_map(|word| word.trim_end_matches("/>").split_once('='));
        let numbers =
            words.filter_map(|(name, value)| Some((name.to_owned(), value.trim_matches('"').parse().ok()?)));
        Self { numbers: numbers.collect() }
    }

    fn get(&self, name: &str) -> f64 {
        *self.numbers.get(name).expect(name)
    }

    /// R = Rz Ry Rx by rows.
    fn rotation(&self) -> [[f64; 3]; 3] {
        let [(sa, ca), (sb, cb), (sc, cc)] = ["rx", "ry", "rz"].map(|angle| self.get(angle).sin_cos());
        [
            [cb * cc, cc * sa * sb - ca * sc, sa * sc + ca * cc * sb],
            [cb * sc, sa * sb * sc + ca * cc, ca * sb * sc - cc * sa],
            [-sb, cb * sa, ca * cb],
        ]
    }

    /// R^T v.
    fn to_world(&self, v: [f64; 3]) -> [f64; 3] {
        let rows = self.rotation();
        [0, 1, 2].map(|axis: usize| (0..3).map(|row| rows[row][axis] * v[row]).sum())
    }

    fn center_mm(&self) -> [f64; 3] {
        self.to_world(["tx", "ty", "tz"].map(|name| -self.get(name)))
    }

    /// Where the ray of a pixel meets z = 0, metres; `None` above the horizon.
    fn ground_m(&self, u: f64, v: f64) -> Option<DVec2> {
        let xd = (u - self.get("cx")) * self.get("dpx") / self.get("sx");
        let yd = (v - self.get("cy")) * self.get("dpy");
        let bend = 1.0 + self.get("kappa1") * (xd * xd + yd * yd);
        let [dx, dy, dz] = self.to_world([xd * bend, yd * bend, self.get("focal")]);
        let [cx, cy, cz] = self.center_mm();
        let along = -cz / dz;
        (along > 0.0).then(|| DVec2::new(cx + along * dx, cy + along * dy) / 1000.0)
    }
}

fn pets_camera(path: &Path) -> Camera {
    let text = std::fs::read_to_string(path).expect("a readable calibration");
    import(&text, None, &ImportOptions::default()).expect("a camera").camera
}

fn ground(half_m: f64) -> Surfaces {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let corners = corners.map(|(x, y)| DVec2::new(x, y) * half_m).to_vec();
    Surfaces::of_ground_and_boxes(vec![GroundPolygon::new(corners, 0.0).expect("ground")], Vec::new())
}

/// Largest and mean distance to the independent inverse within [`FAR_M`], metres, and how many were compared.
fn against_tsai(camera: &Camera, tsai: &Tsai, place: impl Fn(DVec2) -> Option<DVec3>) -> (f64, f64, usize) {
    let (width, height) = camera.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let [cx, cy, cz] = tsai.center_mm();
    let center = DVec3::new(cx, cy, cz) / 1000.0;
    let (mut worst, mut sum, mut n_compared) = (0.0_f64, 0.0, 0);
    for (u, v) in (0..width).step_by(4).flat_map(|u| (0..height).step_by(4).map(move |v| (u, v))) {
        let (u, v) = (f64::from(u), f64::from(v));
        let Some(truth) = tsai.ground_m(u, v) else { continue };
        if truth.extend(0.0).distance(center) > FAR_M {
            continue;
        }
        let found = place((DVec2::new(u, v) + 0.5) / size).expect("ground below the horizon");
        let error = (found - truth.extend(0.0)).length();
        (worst, sum, n_compared) = (worst.max(error), sum + error, n_compared + 1);
    }
    (worst, sum / f64::from(n_compared.max(1) as u32), n_compared)
}

#[test]
fn pets_ground_points_agree_with_an_independent_inverse_to_a_centimetre() {
    let Some(folder) = real_data("pets2009_s2l1/calibration") else { return };
    let surfaces = ground(300.0);
    for view in [1, 2, 3, 5, 6, 8] {
        let path = folder.join(format!("View_00{view}.xml"));
        let (camera, tsai) = (pets_camera(&path), Tsai::read(&path));
        let (worst, mean, n_compared) = against_tsai(&camera, &tsai, |texture| {
            locate(&camera, &surfaces, texture).map(|location| location.point_in_world)
        });
        println!(
            "PETS view {view}: locate within {FAR_M} m: max {worst:.2e} m, mean {mean:.2e} m of {n_compared}"
        );
        // Views 1, 2, 5, 6 and 8 look down on ground this near; view 3 hardly.
        assert!(n_compared > 2_000 || view == 3, "view {view}: {n_compared}");
        assert!(worst <= 0.01, "view {view}: {worst} m");
    }
}

#[test]
fn a_stored_map_of_pets_keeps_the_centimetre() {
    let Some(path) = real_data("pets2009_s2l1/calibration/View_001.xml") else { return };
    let (camera, tsai) = (pets_camera(&path), Tsai::read(&path));
    let surfaces = ground(100.0);
    let map = Builder::Ray.build(&camera, &surfaces, camera.size_px()).expect("a map");
    let bytes = map.encode().expect("bytes");
    let map = WorldMap::decode(&bytes).expect("the map");
    let place = |texture| map.locate(texture).map(|location| location.point_in_world);
    let (worst, mean, n_compared) = against_tsai(&camera, &tsai, place);
    println!(
        "PETS view 1: stored map, {} bytes: max {worst:.2e} m, mean {mean:.2e} m of {n_compared}",
        bytes.len()
    );
    assert!(n_compared > 2_000 && worst <= 0.01, "{worst}");
}

#[test]
fn a_grid_over_pets_keeps_its_stated_bound() {
    let Some(path) = real_data("pets2009_s2l1/calibration/View_001.xml") else { return };
    let camera = pets_camera(&path);
    // Something to hide ground behind, where the view has a sign post's island.
    let island =
        OrientedBox::new(DVec3::new(-5.0, -2.0, 1.0), DVec3::new(2.0, 3.0, 2.0), 0.3).expect("a box");
    let surfaces = Surfaces::of_ground_and_boxes(ground(60.0).ground().cloned().collect(), vec![island]);
    let size = camera.size_px();
    #[expect(clippy::disallowed_methods, reason = "a figure to print, nothing is decided by it")]
    let start = Instant::now();
    let rays = Builder::Ray.build(&camera, &surfaces, size).expect("a map");
    println!("PETS view 1: rays {:?}, covered {:.3}", start.elapsed(), rays.coverage().direct);
    for step_m in [1.0, 0.2, 0.05] {
        #[expect(clippy::disallowed_methods, reason = "a figure to print, nothing is decided by it")]
        let start = Instant::now();
        let map = Builder::Grid(GridSettings { step_m }).build(&camera, &surfaces, size).expect("a map");
        let elapsed = start.elapsed();
        let (mut worst, mut sum, mut n_compared) = (0.0_f64, 0.0, 0_u32);
        for (x, y) in (0..size.0).flat_map(|x| (0..size.1).map(move |y| (x, y))) {
            let (Some(found), Some(truth)) = (map.texel(x, y), rays.texel(x, y)) else { continue };
            if found.surface != truth.surface || !truth.is_reliable {
                continue;
            }
            let error = (found.point_in_world - truth.point_in_world).length();
            let bound = map.error_bound_m(&found);
            assert!(error <= bound, "step {step_m}, {x} {y}: {error} m over {bound} m");
            (worst, sum, n_compared) = (worst.max(error), sum + error, n_compared + 1);
        }
        let mean = sum / f64::from(n_compared);
        let coverage = map.coverage();
        println!(
            "step {step_m} m in {elapsed:?}: direct {:.3}, interpolated {:.3}, max {worst:.4} m, mean {mean:.4} m",
            coverage.direct, coverage.interpolated
        );
        let missing = rays.coverage().direct - coverage.direct - coverage.interpolated;
        assert!(missing.abs() < 0.05, "step {step_m}: {missing} of the texels is missing");
    }
}
